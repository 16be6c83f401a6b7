"""What is wrong with BVH files and is said with its line; what is unusual and means the same; gaps, filled along turns."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bvh_files import CHAIN, written

import articulated as art

pytest.importorskip("pybvh")

BAD = {
    "not a BVH": ("solid cube\n", r"clip.bvh: does not begin with HIERARCHY; give a BVH file"),
    "empty": ("", "does not begin with HIERARCHY"),
    "no hierarchy": ("HIERARCHY\nMOTION\nFrames: 1\nFrame Time: 0.1\n", r":2: the hierarchy is empty; it needs a ROOT"),
    "no MOTION": (CHAIN[: CHAIN.index("MOTION")], r":15: the file ends where the MOTION section should follow"),
    "cut in the hierarchy": (CHAIN[:120], r"the file ends where the rest of the hierarchy should follow"),
    "cut in the frames": (CHAIN.rsplit("\n", 2)[0] + "\n", r":20: there are 2 frames; 'Frames:' says 3"),
    "cut in a frame": (CHAIN[:-6], r":21: frame 2: has 7 values; the hierarchy has 9 channels"),
    "too many values": (CHAIN.replace("0 90 1 0", "0 90 1 0 0"), r":20: frame 1: has 10 values"),
    "no numbers": (
        CHAIN.replace("0 90 1", "0 90 one"),
        r":20: frame 1: could not convert string to float: 'one'; give numbers",
    ),
    "negative frame time": (CHAIN.replace("0.0333333", "-0.03"), r":18: frame time is -0.03; give a positive number"),
    "frame time zero": (CHAIN.replace("0.0333333", "0"), "frame time is 0"),
    "no frame time": (CHAIN.replace("Frame Time: 0.0333333", "Rate: 30"), r":18: 'Rate: 30' is not 'Frame Time: s'"),
    "no count": (CHAIN.replace("Frames: 3", "Frames: three"), r":17: 'Frames: three' is not 'Frames: N'"),
    "no frames": (CHAIN[: CHAIN.index("0 90")].replace("Frames: 3", "Frames: 0"), r":17: there are no frames"),
    "one frame": (
        "\n".join(CHAIN.split("\n")[:19]).replace("Frames: 3", "Frames: 1"),
        "there is one frame; a motion takes two",
    ),
    "same names": (CHAIN.replace("Spine", "Hips"), r":6: joint 'Hips': another joint, of line 2, has this name; rename one"),
    "no name": (CHAIN.replace("JOINT Spine", "JOINT"), r":6: JOINT has no name"),
    "second root": (CHAIN.replace("JOINT Spine", "ROOT Spine"), r":6: joint 'Spine': a second ROOT"),
    "unknown channel": (CHAIN.replace("3 Zrotation", "3 Wrotation"), r":9: joint 'Spine': unknown channel 'Wrotation'"),
    "channels twice": (CHAIN.replace("3 Zrotation", "3 Xrotation"), "CHANNELS names one twice"),
    "channel count": (CHAIN.replace("CHANNELS 3", "CHANNELS 4"), r":9: joint 'Spine': CHANNELS says 4 and names 3"),
    "channels of an end": (CHAIN.replace("OFFSET 0 40 0", "CHANNELS 0"), "end site of 'Spine': an end site has CHANNELS"),
    "offset": (CHAIN.replace("OFFSET 0 50 0", "OFFSET 0 50"), r":8: joint 'Spine': OFFSET is 0 50; give three finite numbers"),
    "offset NaN": (CHAIN.replace("OFFSET 0 50 0", "OFFSET 0 nan 0"), "OFFSET is 0 nan 0"),
    "no offset": (CHAIN.replace("    OFFSET 0 50 0\n", ""), r":6: joint 'Spine': has no OFFSET"),
    "open": (CHAIN.replace("}\nMOTION", "MOTION"), r"joint 'Hips': MOTION comes before the last '}'; close every joint"),
    "closed twice": (CHAIN.replace("}\nMOTION", "}\n}\nMOTION"), r"'}' closes nothing"),
    "outside": (CHAIN.replace("ROOT Hips", "JOINT Hips"), r":2: joint 'Hips': JOINT stands outside of the ROOT"),
    "stray word": (CHAIN.replace("OFFSET 0 50 0", "SCALE 1"), "'SCALE 1' has no meaning here"),
    "gap": (CHAIN.replace("0 90 1 0 5", "0 90 1 0 nan"), r":20: frame 1: 'Hips' Xrotation is nan; mend it, or fill"),
    "sliding bone": (
        CHAIN.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
        .replace("0 90 0 0 0 0 ", "0 90 0 0 0 0 0 50 0 ")
        .replace("10 0 0\n", "0 50 0 10 0 0\n")
        .replace("20 0 0\n", "0 50 9 20 0 0\n"),
        r":6: joint 'Spine': slides by .* only the root may",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    text, match = BAD[name]
    with pytest.raises(art.RigError, match=match):
        art.from_bvh(written(tmp_path, text), scale=0.01)


def test_no_such_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        art.from_bvh(tmp_path / "none.bvh")


def test_all_at_one_place(tmp_path):
    with pytest.raises(ValueError, match="give scale"):
        art.from_bvh(written(tmp_path, re.sub("OFFSET .*", "OFFSET 0 0 0", CHAIN)), up="y")


class TestUnusualFiles:
    """What some readers refuse, and what means the same as the usual form."""

    def same(self, tmp_path, text: str, **options) -> None:
        rig, one = art.from_bvh(written(tmp_path, CHAIN), scale=0.01, up="y")
        other_rig, other = art.from_bvh(written(tmp_path, text, "other.bvh"), scale=0.01, up="y", **options)
        assert list(rig.links) == [name.replace("Lower_", "") for name in other_rig.links]
        np.testing.assert_allclose(other.q, one.q, atol=1e-12)

    def test_braces_on_the_line_of_the_name_and_blanks(self, tmp_path):
        self.same(tmp_path, CHAIN.replace("JOINT Spine\n  {", "JOINT Lower Spine {").replace("\n", "\r\n\r\n"))

    def test_turns_before_positions(self, tmp_path):
        text = CHAIN.replace(
            "Xposition Yposition Zposition Zrotation Xrotation Yrotation",
            "Zrotation Xrotation Yrotation Zposition Xposition Yposition",
        )
        for before, after in (
            ("0 90 0 0 0 0", "0 0 0 0 0 90"),
            ("0 90 1 0 5 0", "0 5 0 1 0 90"),
            ("0 90 2 0 9 0", "0 9 0 2 0 90"),
        ):
            text = text.replace(before, after)
        self.same(tmp_path, text)

    def test_fewer_turns(self, tmp_path):
        text = CHAIN.replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 1 Zrotation")
        self.same(tmp_path, re.sub(r"^(0 90 .*) 0 0$", r"\1", text, flags=re.MULTILINE))

    def test_positions_that_are_the_offset(self, tmp_path):
        text = CHAIN.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
        self.same(tmp_path, re.sub(r"^(0 90 \d \d \d \d) ", r"\1 0 50 0 ", text, flags=re.MULTILINE))
        self.same(tmp_path, re.sub(r"^(0 90 \d \d \d \d) ", r"\1 0 0 0 ", text, flags=re.MULTILINE))
        moved = re.sub(r"^(0 90 \d \d \d \d) ", r"\1 0 60 0 ", text, flags=re.MULTILINE)
        with pytest.warns(
            art.RigWarning, match=r"position channels hold \[0.0, 60.0, 0.0\], not its OFFSET; they take its place"
        ):
            self.same(tmp_path, moved)
        rig, _ = art.from_bvh(written(tmp_path, moved), scale=0.01, up="y")
        np.testing.assert_allclose(rig.joints["Spine"].pose[:3, 3], [0.0, 0.0, 0.6])

    def test_bones_of_no_length_are_told(self, tmp_path):
        with pytest.warns(art.RigWarning, match="bones of no length: Spine"):
            rig, _ = art.from_bvh(written(tmp_path, CHAIN.replace("OFFSET 0 40 0", "OFFSET 0 0 0")), scale=0.01, up="y")
        assert rig.bodies[1].mass > 0.0


class TestGaps:
    def test_they_are_filled_the_shortest_way(self, tmp_path):
        text = CHAIN.replace("0 90 1 0 5 0 10 0 0", "0 90 nan 0 5 0 nan 0 0")
        with pytest.warns(art.RigWarning, match="frame 1 held numbers that are not finite; filled from those before and after"):
            rig, motion = art.from_bvh(written(tmp_path, text), scale=0.01, up="y", repair=True)
        middle = art.integrate(rig, motion.q[0], 0.5 * art.difference(rig, motion.q[0], motion.q[2]))
        np.testing.assert_allclose(motion.q[1][3:], middle[3:], atol=1e-9)
        assert motion.q[1, 0] == pytest.approx(0.01)

    def test_the_way_across_180_degrees_is_short(self, tmp_path):
        text = CHAIN.replace(" 10 0 0\n", " nan 0 0\n").replace(" 0 0 0\n", " 170 0 0\n").replace(" 20 0 0\n", " -170 0 0\n")
        _, motion = art.from_bvh(written(tmp_path, text), scale=0.01, up="y", repair=True, limits=None)
        turns = 2.0 * np.arccos(np.abs(motion.q[:, -1]))
        np.testing.assert_allclose(np.degrees(turns), [170.0, 180.0, 170.0], atol=1e-5)

    def test_not_all_can_be_filled(self, tmp_path):
        text = CHAIN.replace("0 90", "nan 90", 2).replace("OFFSET 0 nan", "OFFSET 0 90")
        with pytest.raises(art.RigError, match="2 of 3 frames are gaps; two whole frames are needed"):
            art.from_bvh(written(tmp_path, text), scale=0.01, repair=True)


def test_what_a_rig_from_a_file_did_is_written_as_that_file(tmp_path):
    import pybvh

    path = written(tmp_path, CHAIN)
    rig, motion = art.from_bvh(path, scale=0.01, up="y")
    run = art.simulate(rig, duration=0.2, fps=30, q0=motion.q[0])
    run.export(tmp_path / "fall.bvh")
    one, two = (pybvh.read_bvh_file(name, world_up="+y") for name in (path, tmp_path / "fall.bvh"))
    assert two.matches_topology(one)
    X = art.link_poses(rig, run.q)[:, rig.links["Spine"].index, :3, 3]
    np.testing.assert_allclose(two.node_positions()[:, 1] * 0.01 @ motion.skeleton.turn.T, X, atol=1e-7)
