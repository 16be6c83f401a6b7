"""Cylinders against balls, capsules, boxes and each other: closed forms, resting, rolling, standing; the same in floats and machine code."""

from __future__ import annotations

import math

import numpy as np
import pytest
from narrow_truths import (
    LEVEL,
    Rotation,
    assert_same_touches,
    check_all_ways,
    euler,
    lying,
    moved_together,
    numbers,
    random_poses,
    shape,
    sizes,
    stacked,
    there,
)

from articulated.simulation.contact.narrow.rollers import rod_roller, roller_block, roller_roller

BOX = (0.3, 0.2, 0.2)
WHEEL = (0.1, 0.03)


def many(x, n):
    return np.broadcast_to(x, (n, 3))


def wheel_on_box(center, rotation, size=WHEEL, half=BOX):
    """The box's top is z = 0."""
    n = len(center)
    return roller_block(
        shape("cylinder", size, center, rotation), shape("box", half, many([0.0, 0.0, -half[2]], n), Rotation.identity(n))
    )


def at(touches, k, what):
    return stacked(touches, what)[k]


def test_ball_touches_halfway():
    rng = np.random.default_rng(3)
    center = rng.normal(scale=0.3, size=(300, 3))
    (touch,) = rod_roller(
        shape("ball", (0.06,), center, Rotation.identity(300)), shape("cylinder", (0.2, 0.1), [0, 0, 0], LEVEL)
    )
    (mere,) = rod_roller(
        shape("ball", (0.0,), stacked([touch], "point")[0], Rotation.identity(300)),
        shape("cylinder", (0.2, 0.1), [0, 0, 0], LEVEL),
    )
    outside = touch.size > 0.0
    assert mere.size[outside] == pytest.approx(0.5 * touch.size[outside], abs=1e-12)


class TestCapsule:
    """What lies on a cylinder rests on two points, in the same places if it is a little askew."""

    @pytest.mark.parametrize("askew", [0.0, 1e-7, 1e-5])
    def test_along_the_side(self, askew):
        rotation = lying() * euler("xy", [askew, askew])
        touches = rod_roller(
            shape("capsule", (0.05, 0.2), [0.03, 0.0, 0.149], rotation), shape("cylinder", (0.1, 0.15), [0, 0, 0], lying())
        )
        assert sizes(touches) == pytest.approx(-1e-3, abs=1e-5)
        assert at(touches, slice(1, 3), "point")[:, 0] == pytest.approx([-0.15, 0.15], abs=1e-3)
        assert abs(at(touches, 0, "point")[0]) < 0.05  # the nearest is between them
        assert stacked(touches, "normal") == pytest.approx(many([0.0, 0.0, 1.0], 3), abs=1e-4)

    @pytest.mark.parametrize("askew", [0.0, 1e-7, 1e-5])
    def test_across_the_end(self, askew):
        rotation = lying() * euler("xy", [askew, askew])
        touches = rod_roller(
            shape("capsule", (0.05, 0.2), [0.0, 0.06, 0.199], rotation), shape("cylinder", (0.1, 0.15), [0, 0, 0], LEVEL)
        )
        assert sizes(touches) == pytest.approx(-1e-3, abs=1e-5)
        assert at(touches, slice(1, 3), "point") == pytest.approx(
            np.array([[-0.08, 0.06, 0.1495], [0.08, 0.06, 0.1495]]), abs=1e-3
        )

    def test_longer_cylinder(self):
        touches = rod_roller(
            shape("capsule", (0.05, 0.1), [0.0, 0.0, 0.16], lying()), shape("cylinder", (0.1, 0.3), [0, 0, 0], lying())
        )
        assert sizes(touches) == pytest.approx(0.01)
        assert at(touches, slice(1, 3), "point")[:, 0] == pytest.approx([-0.1, 0.1])

    def test_deep_inside_stays_finite(self):
        """Also where the two axes are one, and where a ball is on the axis."""
        for kind, size in (("ball", (0.01,)), ("capsule", (0.01, 0.02))):
            for turn in (LEVEL, lying()):
                touches = rod_roller(shape(kind, size, [0.0, 0.0, 0.0], turn), shape("cylinder", (0.1, 0.2), [0, 0, 0], LEVEL))
                assert np.isfinite(numbers(touches)).all()
                assert np.linalg.norm(stacked(touches, "normal"), axis=-1) == pytest.approx(1.0)
                assert sizes(touches)[0] < -0.1


class TestWheelOnBox:
    def test_rolls_as_on_a_plane(self):
        """For any roll and heading, the lowest points of both rims are as deep as they would be in a plane."""
        rng = np.random.default_rng(1)
        roll, yaw = rng.uniform(-np.pi, np.pi, (2, 500))
        center = np.column_stack([rng.uniform(-0.15, 0.15, 500), rng.uniform(-0.05, 0.05, 500), rng.uniform(0.098, 0.12, 500)])
        touches = wheel_on_box(center, lying(yaw, roll))
        assert (there(touches).sum(axis=0) == 2).all()
        assert sizes(touches)[:2] == pytest.approx(np.broadcast_to(center[:, 2] - 0.1, (2, 500)), abs=1e-12)
        along = 0.03 * np.column_stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw])
        lowest = center * [1.0, 1.0, 0.0]
        points = stacked(touches, "point")[:2] * [1.0, 1.0, 0.0]
        assert np.sort(points, axis=0) == pytest.approx(np.sort([lowest - along, lowest + along], axis=0), abs=1e-9)
        assert stacked(touches, "normal") == pytest.approx(np.broadcast_to([0.0, 0.0, 1.0], (4, 500, 3)))

    @pytest.mark.parametrize("camber", [1e-4, 0.01, 0.1, 0.5])
    def test_leans(self, camber):
        """The higher rim is told as long as a wheel may soon stand on it."""
        touches = wheel_on_box(np.array([[0.0, 0.0, 0.12]]), lying([0.3], 0.0, camber))
        expected = 0.12 - 0.1 * math.cos(camber) + 0.03 * math.sin(camber) * np.array([-1.0, 1.0])
        count = 2 if camber < 0.2 else 1
        assert there(touches).sum() == count
        assert np.sort(sizes(touches)[:, 0])[:count] == pytest.approx(expected[:count], abs=1e-12)

    def test_slots_keep_their_rims(self):
        """A wheel that rolls, sways and turns keeps each rim in a slot."""
        t = np.linspace(0.0, 1.0, 200)
        center = np.column_stack([0.1 * t, 0.02 * np.sin(9.0 * t), 0.0995 + 0.0004 * np.sin(40.0 * t)])
        touches = wheel_on_box(center, lying(0.3 * t, 5.0 * t, 0.004 * np.sin(30.0 * t)))
        points = stacked(touches, "point")[:2]
        assert np.abs(np.diff(points, axis=1)).max() < 2e-3
        assert np.abs(np.diff(sizes(touches)[:2], axis=1)).max() < 1e-3

    def test_rolls_over_an_edge(self):
        """Gap and normal do not jump where the face ends; beyond, it is the edge that is touched."""
        x = np.linspace(0.2, 0.39, 400)
        center = np.column_stack([x, 0.0 * x, np.full(400, 0.0999)])
        touches = wheel_on_box(center, lying(np.full(400, 0.5 * np.pi)))
        beyond = np.maximum(x - 0.3, 0.0)
        assert sizes(touches)[:2] == pytest.approx(np.broadcast_to(np.hypot(beyond, 0.0999) - 0.1, (2, 400)), abs=1e-5)
        normals = stacked(touches, "normal")[0]
        assert normals == pytest.approx(
            np.column_stack([beyond, 0.0 * x, np.full(400, 0.0999)]) / np.hypot(beyond, 0.0999)[:, None], abs=1e-4
        )
        assert np.ptp(stacked(touches, "point")[:2, :, 1], axis=0) == pytest.approx(0.06, abs=1e-4)

    def test_rim_near_an_edge(self):
        """A level cylinder whose rim is near an upright edge: it looks at it askew, and touches there."""
        way = np.array([math.sin(0.15), math.cos(0.15), 0.0])
        for gap in (0.02, 0.05):
            rim = np.array([0.3, 0.2, -0.1]) + gap * way  # from the box's edge
            center = rim + np.array([0.03, 0.1, 0.0])  # its axis is along x
            touches = wheel_on_box(center[None], lying([0.0]))
            k = int(np.argmin(sizes(touches)[:, 0]))
            assert sizes(touches)[k, 0] == pytest.approx(gap, rel=1e-3)
            assert stacked(touches, "normal")[k, 0] == pytest.approx(way, abs=0.05)
            assert stacked(touches, "point")[k, 0] == pytest.approx([0.3, 0.2, -0.1] + 0.5 * gap * way, abs=1e-3)

    def test_longer_than_the_box(self):
        touches = wheel_on_box(np.array([[0.05, 0.0, 0.0495]]), lying([0.0]), size=(0.05, 0.6))
        assert sizes(touches)[:2, 0] == pytest.approx(-5e-4)
        assert np.sort(stacked(touches, "point")[:2, 0, 0]) == pytest.approx([-0.3, 0.3], abs=1e-5)


class TestStanding:
    def support(self, touches, deepest=0.0):
        """Points that carry, as seen from above."""
        held = sizes(touches)[:, 0] < deepest
        return stacked(touches, "point")[held, 0, :2]

    @pytest.mark.parametrize("spin", [0.0, 0.4, 1.1])
    def test_on_a_face(self, spin):
        touches = wheel_on_box(np.array([[0.05, 0.02, 0.049]]), euler("z", [[spin]]), size=(0.1, 0.05))
        points = self.support(touches) - [0.05, 0.02]
        assert len(points) == 4
        assert sizes(touches)[:, 0] == pytest.approx(-1e-3)
        assert np.linalg.norm(points, axis=1) == pytest.approx(0.1)
        angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
        assert np.diff([*angles, angles[0] + 2.0 * np.pi]) == pytest.approx(0.5 * np.pi, abs=0.11)

    def test_beyond_an_edge(self):
        """It stands on what of the face is left: its middle is within the points that carry as long as it is over the face."""
        for x in (0.22, 0.26, 0.295):
            points = self.support(wheel_on_box(np.array([[x, 0.02, 0.049]]), euler("z", [[0.2]]), size=(0.1, 0.05)))
            assert len(points) >= 3
            assert min(0.3, x + 0.07) - 1e-5 < points[:, 0].max() < 0.3 + 1e-5
            assert points[:, 0].min() < x - 0.04
            assert points[:, 1].min() < 0.02 - 0.04
            assert points[:, 1].max() > 0.02 + 0.04

    def test_on_a_smaller_box(self):
        points = self.support(
            wheel_on_box(np.array([[0.05, 0.02, 0.049]]), euler("z", [[0.2]]), size=(0.3, 0.05), half=(0.1, 0.08, 0.2))
        )
        assert sorted(map(tuple, np.round(np.abs(points), 4).tolist())) == [(0.1, 0.08)] * 4

    @pytest.mark.parametrize("tilt", [1e-7, 1e-6, 1e-5])
    def test_slots_stay(self, tilt):
        """However it trembles, every slot keeps its place."""
        way = np.linspace(0.0, 6.0, 50)
        rotation = Rotation.from_rotvec(tilt * np.column_stack([np.cos(way), np.sin(way), 0.0 * way]))
        points = stacked(wheel_on_box(many([0.05, 0.02, 0.049], 50), rotation, size=(0.1, 0.05)), "point")
        assert np.abs(points - points[:, :1]).max() < 1e-5

    def test_lowest_is_told(self):
        """A cylinder that tips over its rim: its lowest point is among the four; of those in the ground, one nearly as low is enough."""
        tilt = np.geomspace(1e-5, 1.2, 60)
        rotation = Rotation.from_rotvec(np.outer(tilt, [0.6, 0.8, 0.0]))
        lowest = -(0.1 * np.sin(tilt) + 0.05 * np.cos(tilt))
        for gap, told in ((1e-4, 1.1e-5), (-1e-4, 4e-5)):
            touches = wheel_on_box(np.column_stack([0.0 * tilt, 0.0 * tilt, gap - lowest]), rotation, size=(0.1, 0.05))
            assert (sizes(touches).min(axis=0) > gap - 1e-9).all()
            assert (sizes(touches).min(axis=0) < gap + told).all()

    def test_corner_in_its_end(self):
        """A cube on its corner under a standing cylinder."""
        diagonal, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [[1.0, 1.0, 1.0]])
        box = shape("box", (0.1, 0.1, 0.1), [0.0, 0.0, 0.0], diagonal)
        touches = roller_block(shape("cylinder", (0.2, 0.05), [0.03, 0.02, 0.1 * math.sqrt(3.0) + 0.049], LEVEL), box)
        assert there(touches).sum() == 1
        k = int(np.argmin(sizes(touches)))
        assert sizes(touches)[k] == pytest.approx(-1e-3)
        assert at(touches, k, "normal") == pytest.approx([0.0, 0.0, 1.0])
        assert at(touches, k, "point") == pytest.approx([0.0, 0.0, 0.1 * math.sqrt(3.0) - 5e-4], abs=1e-6)

    @pytest.mark.parametrize(("rotation", "count"), [(LEVEL, 2), (lying(), 2), (lying(0.5 * np.pi), 1), (lying(0.7), 1)])
    def test_on_an_edge(self, rotation, count):
        """A cube on its edge, which is along x: under a cylinder's end, along its side, across its side."""
        box = shape("box", (0.2, 0.1, 0.1), [0.0, 0.0, 0.0], euler("x", 0.25 * np.pi))
        height = 0.1 if rotation.magnitude() == 0.0 else 0.15
        touches = roller_block(shape("cylinder", (0.15, 0.1), [0.0, 0.0, 0.1 * math.sqrt(2.0) + height - 1e-3], rotation), box)
        carry = sizes(touches) < 0.0
        assert carry.sum() == count
        assert sizes(touches)[carry] == pytest.approx(-1e-3, abs=1e-5)
        points = stacked(touches, "point")[carry]
        assert points[:, 1:] == pytest.approx(np.broadcast_to([0.0, 0.1 * math.sqrt(2.0) - 5e-4], (count, 2)), abs=1e-4)
        if count == 2:
            reach = 0.15 if rotation.magnitude() == 0.0 else 0.1
            assert np.sort(points[:, 0]) == pytest.approx([-reach, reach], abs=1e-4)


PAIRS = [
    (rod_roller, ("ball", (0.05,)), ("cylinder", (0.1, 0.2))),
    (rod_roller, ("capsule", (0.05, 0.2)), ("cylinder", (0.1, 0.2))),
    (roller_block, ("cylinder", (0.1, 0.2)), ("box", (0.2, 0.15, 0.1))),
    (roller_roller, ("cylinder", (0.1, 0.2)), ("cylinder", (0.2, 0.05))),
]


@pytest.mark.parametrize(("function", "first", "second"), PAIRS)
class TestAll:
    def test_floats_and_machine_code_equal_arrays(self, function, first, second):
        check_all_ways(function, first, second, random_poses(200))

    def test_moved_together(self, function, first, second):
        """It does not matter where in the world two bodies are; but for two cylinders, to which points of their ends are told."""
        here, moved = moved_together(function, first, second, random_poses(200))
        alike = np.isclose(sizes(here).min(axis=0), sizes(moved).min(axis=0), atol=1e-5)
        if function is roller_roller:
            assert alike.mean() > 0.95
        else:
            assert alike.all()
            assert_same_touches(here, moved)
