"""Polyhedra against balls, capsules, cylinders and boxes: MuJoCo's distances, resting; all of hulls in floats and machine code."""

from __future__ import annotations

import math

import numpy as np
import pytest
from narrow_truths import (
    CUBE,
    LEVEL,
    SLAB,
    SOLIDS,
    WEDGE,
    Pair,
    Rotation,
    assert_same_touches,
    box,
    carrying,
    check_all_ways,
    euler,
    moved_together,
    random_poses,
    rock,
    shape,
    sizes,
    stacked,
    vector,
)

from articulated.simulation.contact.narrow.hulls import hull_block, hull_hull, hull_rod, hull_roller
from articulated.simulation.contact.narrow.reduction import Across
from articulated.simulation.contact.narrow.rollers import roller_block


def test_axes_across_any_normal():
    """Unit vectors square to each other, right-handed, for all normals: also for those by which they are chosen."""
    n = np.random.default_rng(0).normal(size=(3000, 3))
    n[:2] = [0.6230, 0.5399, 0.5660], [0.6210, -0.7770, 0.1030]
    n /= np.linalg.norm(n, axis=1)[:, None]
    for way in (1.0, -1.0):
        across = Across.of(vector(way * n))
        R = np.array([[*across.u], [*across.v], [*across.n]]).transpose(2, 0, 1)
        assert R @ R.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), R.shape), abs=1e-9)
        assert np.linalg.det(R) == pytest.approx(1.0)


class TestRodsAndRollers:
    def compare(self, function, solid, other, width, count=300):
        pytest.importorskip("mujoco")
        rng = np.random.default_rng(2)
        pair = Pair(other, ("hull", solid))
        center, rotation, distance = pair.near(rng, count, width)
        a, b = pair.placed(center, rotation, Rotation.random(rng=rng), rng.normal(size=3))
        touches = function(b, a)
        assert np.linalg.norm(stacked(touches, "normal"), axis=-1) == pytest.approx(1.0, abs=1e-9)
        assert np.isfinite(stacked(touches, "point")).all()
        return sizes(touches), distance

    @pytest.mark.parametrize("name", SOLIDS)
    def test_ball(self, name):
        found, distance = self.compare(hull_rod, SOLIDS[name], ("ball", (0.06,)), 0.03)
        assert found[0] == pytest.approx(distance, abs=1e-6)

    @pytest.mark.parametrize("name", SOLIDS)
    def test_capsule(self, name):
        found, distance = self.compare(hull_rod, SOLIDS[name], ("capsule", (0.05, 0.2)), 0.02)
        assert found.min(axis=0) == pytest.approx(distance, abs=1e-5)

    @pytest.mark.parametrize("size", [(0.1, 0.15), (0.2, 0.03), (0.03, 0.3)])
    @pytest.mark.parametrize("name", SOLIDS)
    def test_cylinder(self, name, size):
        found, distance = self.compare(hull_roller, SOLIDS[name], ("cylinder", size), 0.01)
        gap, overlap = found.min(axis=0), distance < 0.0
        assert (gap[~overlap] > -1e-3).all()
        assert np.mean(gap[~overlap] > 0.0) > 0.99
        assert np.mean(gap[overlap] < 0.0) > 0.96
        assert np.mean(gap[~overlap] < 1.0) > 0.95
        seen = ~overlap & (gap < 1.0)
        assert np.quantile(np.abs(gap - distance)[seen], 0.95) < 1e-3

    def test_capsule_rests(self):
        """On a face, along a ridge and across it."""
        down = np.array([0.0, 0.0, -1.0])  # from the rod to the hull
        ridge = math.sqrt(2.0) * 0.1
        for solid, turn, lie, height, expected in (
            (CUBE, LEVEL, "y", 0.1, [[-0.1, 0.0], [0.1, 0.0]]),
            (SLAB, LEVEL, "y", 0.1, [[-0.2, 0.0], [0.2, 0.0]]),
            (box(0.15, 0.1, 0.1), euler("x", 0.25 * np.pi), "y", ridge, [[-0.15, 0.0], [0.15, 0.0]]),
            (box(0.15, 0.1, 0.1), euler("x", 0.25 * np.pi), "x", ridge, [[0.0, 0.0]]),
        ):
            rod = shape("capsule", (0.05, 0.2), [0.0, 0.0, height + 0.049], euler(lie, 0.5 * np.pi))
            held, normals, points = carrying(hull_rod(shape("hull", solid, [0.0, 0.0, 0.0], turn), rod))
            assert held == pytest.approx([-1e-3] * len(expected), abs=3e-6)
            assert normals == pytest.approx(np.broadcast_to(down, normals.shape), abs=1e-4)
            assert points[np.argsort(points[:, 0]), :2] == pytest.approx(np.array(expected), abs=1e-4)

    def test_box_is_a_hull(self):
        """The same points whether a box is a box or a hull."""
        rng = np.random.default_rng(5)
        p, R, q, Q = (
            rng.normal(scale=0.15, size=(200, 3)),
            Rotation.random(200, rng),
            np.zeros((200, 3)),
            Rotation.random(200, rng),
        )
        as_hull, as_box = shape("hull", box(0.2, 0.15, 0.1), q, Q), shape("box", (0.2, 0.15, 0.1), q, Q)
        rock_of_8 = shape("hull", rock(8), p, R)
        one, other = hull_block(rock_of_8, as_box), hull_hull(rock_of_8, as_hull)
        assert sizes(one) == pytest.approx(sizes(other), abs=1e-9)
        cylinder = shape("cylinder", (0.1, 0.15), p, R)
        one, other = roller_block(cylinder, as_box), hull_roller(as_hull, cylinder)
        assert sizes(one) == pytest.approx(sizes(other), abs=1e-9)
        assert stacked(one, "normal") == pytest.approx(-stacked(other, "normal"), abs=1e-9)


PAIRS = [
    (hull_rod, ("hull", WEDGE), ("ball", (0.05,))),
    (hull_rod, ("hull", WEDGE), ("capsule", (0.05, 0.2))),
    (hull_roller, ("hull", WEDGE), ("cylinder", (0.1, 0.2))),
    (hull_block, ("hull", WEDGE), ("box", (0.2, 0.15, 0.1))),
    (hull_hull, ("hull", WEDGE), ("hull", rock(8))),
]


@pytest.mark.parametrize(("function", "first", "second"), PAIRS)
class TestAll:
    def test_floats_and_machine_code_equal_arrays(self, function, first, second):
        check_all_ways(function, first, second, random_poses(150))

    def test_moved_together(self, function, first, second):
        here, moved = moved_together(function, first, second, random_poses(150))
        assert_same_touches(here, moved)
        assert sizes(here) == pytest.approx(sizes(moved), abs=1e-9)
