"""The table of de Leva against itself: what its rows say of one part of the body between several landmarks must agree."""

import dataclasses
import math

import pytest

from articulated.rig.anthropometry import BOTH_SIDES, MEAN_HEIGHT, MEAN_MASS, other_ends, segments

SEXES = ("female", "male")

SAME_PART = {  # with the same proximal end
    "head to cervicale": "head",
    "forearm to stylion": "forearm",
    "hand to fingertip": "hand",
    "shank to ankle": "shank",
    "shank to sphyrion": "shank",
}


@pytest.mark.parametrize("sex", SEXES)
class TestTable:
    def test_masses_add_up(self, sex):
        total = sum((2 if s.name in BOTH_SIDES else 1) * s.mass for s in segments(sex).values())
        assert total == pytest.approx({"female": 0.9999, "male": 1.0}[sex], abs=1e-12)
        trunk = sum(segments(sex)[f"{which}_trunk"].mass for which in ("upper", "middle", "lower"))
        assert trunk == pytest.approx(other_ends(sex)["trunk"].mass, abs=1e-12)

    def test_names(self, sex):
        assert list(segments(sex)) == [
            *("head", "upper_trunk", "middle_trunk", "lower_trunk"),
            *("upper_arm", "forearm", "hand", "thigh", "shank", "foot"),
        ]
        assert all(name == s.name for table in (segments(sex), other_ends(sex)) for name, s in table.items())

    def test_the_parts_of_the_trunk_add_up(self, sex):
        s, others = segments(sex), other_ends(sex)
        below = s["middle_trunk"].length + s["lower_trunk"].length
        assert s["upper_trunk"].length + below == pytest.approx(others["trunk"].length, abs=1.01e-4)
        assert others["upper_trunk from cervicale"].length + below == pytest.approx(
            others["trunk from cervicale"].length, abs=1.01e-4
        )

    @pytest.mark.parametrize("other", SAME_PART)
    def test_one_part_between_several_landmarks(self, sex, other):
        """From one proximal end: the same centre, and the same radii of gyration, to the printed digits."""
        a, b = segments(sex)[SAME_PART[other]], other_ends(sex)[other]
        assert a.mass == b.mass
        assert a.proximal == b.proximal
        digits = 1e-4 * (a.length + b.length)
        assert a.center * a.length == pytest.approx(b.center * b.length, abs=digits)
        for axis in ("sagittal", "transverse", "longitudinal"):
            assert getattr(a, axis) * a.length == pytest.approx(getattr(b, axis) * b.length, abs=6 * digits)

    @pytest.mark.parametrize("other", ["trunk from cervicale", "trunk from shoulders", "upper_trunk from cervicale"])
    def test_one_part_to_the_same_distal_end(self, sex, other):
        a = {**segments(sex), **other_ends(sex)}[other.split(" from ")[0]]
        b = other_ends(sex)[other]
        assert (1 - a.center) * a.length == pytest.approx((1 - b.center) * b.length, abs=1e-4)
        for axis in ("sagittal", "transverse", "longitudinal"):
            assert getattr(a, axis) * a.length == pytest.approx(getattr(b, axis) * b.length, abs=6e-4 * (a.length + b.length))

    def test_the_parts_of_the_trunk_make_the_trunk(self, sex):
        """By the parallel-axis theorem. The table's own centre of the male trunk is 3 mm off that of its parts."""
        parts, whole = [segments(sex)[f"{which}_trunk"] for which in ("upper", "middle", "lower")], other_ends(sex)["trunk"]
        above = [0.0, parts[0].length, parts[0].length + parts[1].length]
        centers = [z + s.center * s.length for z, s in zip(above, parts, strict=True)]
        middle = sum(s.mass * z for s, z in zip(parts, centers, strict=True)) / whole.mass
        assert middle == pytest.approx(whole.center * whole.length, abs={"female": 1e-4, "male": 3.1e-3}[sex])
        for axis, far in (("sagittal", 1.0), ("transverse", 1.0), ("longitudinal", 0.0)):
            moments = (
                (getattr(s, axis) * s.length) ** 2 + far * (z - middle) ** 2 for s, z in zip(parts, centers, strict=True)
            )
            radius = math.sqrt(sum(s.mass * k for s, k in zip(parts, moments, strict=True)) / whole.mass)
            assert radius / whole.length == pytest.approx(getattr(whole, axis), abs=6e-4)

    def test_a_body_could_be_made_so(self, sex):
        """Principal moments obey the triangle inequality, and centres lie between the ends."""
        for s in [*segments(sex).values(), *other_ends(sex).values()]:
            squares = sorted((s.sagittal**2, s.transverse**2, s.longitudinal**2))
            assert squares[0] + squares[1] >= squares[2], s.name
            assert 0.0 < s.center < 1.0

    def test_nobody_can_change_it(self, sex):
        with pytest.raises(dataclasses.FrozenInstanceError):
            segments(sex)["head"].mass = 1.0
        with pytest.raises(TypeError):
            segments(sex)["head"] = None


def test_as_printed():
    """A few cells of the table, read off it."""
    thigh = segments("male")["thigh"]
    assert (thigh.proximal, thigh.distal, thigh.length, thigh.mass, thigh.center) == ("hip", "knee", 0.4222, 0.1416, 0.4095)
    foot = segments("female")["foot"]
    assert (foot.length, foot.mass, foot.center) == (0.2283, 0.0129, 0.4014)
    assert (foot.sagittal, foot.transverse, foot.longitudinal) == (0.299, 0.279, 0.139)
    assert MEAN_HEIGHT == {"female": 1.735, "male": 1.741}
    assert MEAN_MASS == {"female": 61.9, "male": 73.0}


@pytest.mark.parametrize("sex", ["Male", "other", None, 3])
@pytest.mark.parametrize("table", [segments, other_ends])
def test_no_such_column(table, sex):
    with pytest.raises(ValueError, match=r"sex is .*; expected 'female' or 'male', the two columns of de Leva's table"):
        table(sex)
