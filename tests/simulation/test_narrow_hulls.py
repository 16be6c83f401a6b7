"""Two polyhedra: programs for distance and overlap, closed forms, resting on faces, edges and corners, no flicker."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from narrow_truths import (
    CUBE,
    LEVEL,
    LIMB,
    NEEDLE,
    PLANK,
    SLAB,
    WEDGE,
    Rotation,
    apart,
    box,
    carrying,
    corners,
    depth,
    euler,
    from_rows,
    halfspaces,
    numbers,
    prism,
    random_poses,
    rock,
    rows,
    shape,
    sizes,
    stacked,
    there,
)
from scipy.spatial import ConvexHull

from articulated.compiler import Array, Program, compiled
from articulated.simulation.contact.meeting import each_meeting, meet
from articulated.simulation.contact.narrow.hulls import hull_hull
from articulated.simulation.contact.narrow.solids import Solid
from articulated.simulation.contact.polyhedra import polyhedron


def two(a, center, rotation, b, turn=LEVEL):
    """Two hulls, the second in the middle."""
    return hull_hull(shape("hull", a, center, rotation), shape("hull", b, np.zeros(np.shape(center)), turn))


def near(a, b, count, width, seed=0):
    """Poses of a in which hulls are about so far apart, or deep in each other, and the separation along the best of all axes."""
    rng = np.random.default_rng(seed)
    rotation, along = Rotation.random(count, rng), rng.normal(size=(count, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    low, high = np.zeros(count), np.full(count, 2.0)
    for _ in range(12):
        middle = 0.5 * (low + high)
        overlap = separation(a, b, along * middle[:, None], rotation) < 0.0
        low, high = np.where(overlap, middle, low), np.where(overlap, high, middle)
    center = along * (high + rng.uniform(-width, width, count))[:, None]
    return center, rotation, separation(a, b, center, rotation)


def separation(a, b, center, rotation):
    """Along the best axis of all faces and all pairs of edges."""
    R = rotation.as_matrix()
    P, Q = np.array(a.vertices), np.array(b.vertices)
    directions = [np.array([P[j] - P[i] for i, j in a.edges]), np.array([Q[j] - Q[i] for i, j in b.edges])]
    normals = [np.array([face[0] for face in solid.faces]) for solid in (a, b)]
    crossed = np.cross((directions[0] @ np.swapaxes(R, 1, 2))[:, :, None], directions[1]).reshape(len(R), -1, 3)
    faces = np.broadcast_to(normals[1], (len(R), *normals[1].shape))
    axes = np.concatenate([normals[0] @ np.swapaxes(R, 1, 2), faces, crossed], axis=1)
    length = np.linalg.norm(axes, axis=-1)
    axes = axes / np.maximum(length, 1e-12)[..., None]
    p = np.einsum("nak,nvk->nav", axes, center[:, None] + P @ np.swapaxes(R, 1, 2))
    q = axes @ Q.T
    return np.where(length > 1e-6, np.maximum(p.min(-1) - q.max(-1), q.min(-1) - p.max(-1)), -9.0).max(axis=1)


SOLIDS = [WEDGE, CUBE, NEEDLE, rock(8), rock(12)]


class TestManyHulls:
    """Hulls of all sorts share their code: each is told as if it had as many vertices, faces and edges as the largest."""

    @pytest.mark.parametrize("kind", ["ball", "capsule", "box", "cylinder", "hull"])
    def test_what_is_added_makes_no_difference(self, kind):
        p, R, q, Q = random_poses(500)
        most = Solid.of(rock(12)).filled((13, 24, 9, 40))
        for solid in SOLIDS:
            hull = shape("hull", solid, p, R)
            other = shape(kind, {"hull": solid, "box": (0.1, 0.2, 0.15)}.get(kind, (0.1, 0.2)[: 1 + (kind != "ball")]), q, Q)
            expected = meet(hull, other)
            full = meet(replace(hull, solid=hull.solid.filled(most.counts)), other)
            assert (sizes(expected).min(axis=0) < 0.0).any()
            np.testing.assert_array_equal(numbers(full), numbers(expected))

    def test_rows_of_machine_code(self):
        n, pairs = 200, list(itertools.combinations(SOLIDS, 2))
        p, R, q, Q = random_poses(n)
        first, second = rows("hull", None, p, R), rows("hull", None, q, Q)

        def meetings(a, b):
            shapes = [(from_rows("hull", x, a), from_rows("hull", y, b)) for x, y in pairs]
            return [x for touches in each_meeting(shapes, meet) for x in numbers(touches)]

        expected = [numbers(hull_hull(shape("hull", a, p, R), shape("hull", b, q, Q))) for a, b in pairs]
        expected = np.array(expected).reshape(-1, n).T
        arguments, result = (Array("a", (5, 3)), Array("b", (5, 3))), (Array("touches", expected.shape[1:]),)
        program = Program("hulls", b"rows of hulls", arguments, result, lambda _, a, b: [meetings(a, b)])
        found = np.empty(expected.shape)
        compiled(program, False)([(x, x.strides[0], 0, None) for x in (first, second, found)], n, 1)
        error = np.abs(found - expected).reshape(n, -1, 7)
        error[expected.reshape(n, -1, 7)[..., 0] > 100.0] = 0.0  # nobody asks where a point is that is far
        assert np.mean(error.max(axis=(1, 2)) < 1e-9) > 0.99


class TestTwoHulls:
    @pytest.mark.parametrize(
        ("a", "b", "told"),
        [
            (CUBE, CUBE, 0.999),
            (CUBE, PLANK, 0.999),
            (WEDGE, WEDGE, 0.99),
            (rock(8), rock(8), 0.99),
            (rock(12), WEDGE, 0.99),
            (LIMB, LIMB, 0.994),
        ],
    )
    def test_sign_and_size(self, a, b, told):
        """Overlap is told of nearly all poses near touching, and never where there is none; gaps are those of the best axis."""
        center, rotation, best = near(a, b, 600, 0.01)
        gap = sizes(two(a, center, rotation, b)).min(axis=0)
        overlap = best < 0.0
        assert not (gap[~overlap] < -3e-6).any()
        assert np.mean(gap[overlap] < 0.0) > told
        assert np.mean(np.abs(gap - best)[overlap] < 1e-5) > 0.98
        assert np.mean(gap[~overlap] < 1.0) > 0.99
        seen = ~overlap & (gap < 1.0)
        assert (gap - best)[seen].min() > -1e-5
        assert np.quantile((gap - best)[seen], 0.9) < 0.01

    def test_needles(self):
        """Of sharp bodies the best axis is often missed; still none are told to be deep in each other that are not."""
        center, rotation, best = near(NEEDLE, NEEDLE, 600, 0.01)
        gap = sizes(two(NEEDLE, center, rotation, NEEDLE)).min(axis=0)
        assert (gap[best > 0.0] > -0.012).all()
        assert np.mean(gap[best > 0.0] > -1e-5) > 0.99
        assert np.mean(gap[best < 0.0] < 0.0) > 0.85

    def test_corner_beyond_an_edge(self):
        """A corner above a face and beyond its side: the normal goes from the edge to the corner."""
        diagonal, _ = Rotation.align_vectors([[-1.0, 0.0, -1.0]], [[1.0, 1.0, 1.0]])
        corner = np.array([0.32, 0.05, 0.12])
        touches = two(CUBE, corner + np.array([1.0, 0.0, 1.0]) * 0.1 * math.sqrt(1.5), diagonal, SLAB)
        k = int(np.argmin(sizes(touches)))
        assert sizes(touches)[k] == pytest.approx(0.02 * math.sqrt(2.0), abs=1e-6)
        assert stacked(touches, "normal")[k] == pytest.approx(np.array([1.0, 0.0, 1.0]) / math.sqrt(2.0), abs=1e-6)
        assert stacked(touches, "point")[k] == pytest.approx([0.31, 0.05, 0.11], abs=3e-6)

    def test_programs_agree(self):
        """Of 60 poses: a linear program tells whether there is a point in both, a quadratic one how far apart they are."""
        a, b = rock(8), WEDGE
        center, rotation, _ = near(a, b, 60, 0.02, seed=3)
        touches = two(a, center, rotation, b)
        gap, missed = sizes(touches).min(axis=0), 0
        for k in range(60):
            R = rotation[k].as_matrix()
            ball = depth(halfspaces(a, center[k], R), halfspaces(b, np.zeros(3), np.eye(3)))
            if ball > 0.0:
                missed += gap[k] > 0.0
                continue
            distance = apart(corners(a, center[k], R), corners(b, np.zeros(3), np.eye(3)))
            assert gap[k] > -1e-6
            if gap[k] < 1.0:
                i = int(np.argmin(sizes(touches)[:, k]))
                normal = stacked(touches, "normal")[i, k]
                between = (corners(a, center[k], R) @ normal).min() - (corners(b, np.zeros(3), np.eye(3)) @ normal).max()
                assert between - 3e-6 < gap[k]  # no smaller than along the normal
                assert between < distance + 1e-6
        assert missed <= 1

    @pytest.mark.parametrize("yaw", [0.0, 1e-6, 0.3, 0.25 * np.pi, 1.2, 0.5 * np.pi])
    @pytest.mark.parametrize(
        ("upper", "lower"), [(CUBE, CUBE), (prism(6, 0.1, 0.1), prism(5, 0.1, 0.1)), (prism(3, 0.15, 0.1), CUBE)]
    )
    def test_face_on_face(self, upper, lower, yaw):
        """Gaps are those of the two planes; the points are as far apart as the faces' overlap is wide, and in both."""
        height = max(v[2] for v in lower.vertices) - min(v[2] for v in upper.vertices)
        for gap in (-1e-3, 0.02):
            touches = two(upper, np.array([0.02, 0.01, height + gap]), euler("z", yaw), lower)
            found = there(touches)
            assert found.sum() >= 3
            assert sizes(touches)[found] == pytest.approx(gap, abs=1e-9)
            assert stacked(touches, "normal")[found] == pytest.approx(
                np.broadcast_to([0.0, 0.0, 1.0], (found.sum(), 3)), abs=1e-9
            )
            points = stacked(touches, "point")[found]
            assert points[:, 2] == pytest.approx(height + min(v[2] for v in upper.vertices) + 0.5 * gap)
            for solid, middle, turn in ((upper, [0.02, 0.01, 0.0], euler("z", yaw)), (lower, [0.0, 0.0, 0.0], LEVEL)):
                inside = halfspaces(solid, middle, turn.as_matrix())
                sides = inside[np.abs(inside[:, 2]) < 0.1]
                assert (points @ sides[:, :3].T - sides[:, 3]).max() < 1e-5
            assert ConvexHull(points[:, :2]).volume > 0.4 * common(upper, lower, [0.02, 0.01], yaw)

    @pytest.mark.parametrize(("upper", "lower"), [(box(0.05, 0.04, 0.1), SLAB), (SLAB, box(0.05, 0.04, 0.1))])
    def test_small_and_large(self, upper, lower):
        touches = two(upper, np.array([0.1, -0.05, 0.199]), euler("z", 0.4), lower)
        held, _, points = carrying(touches)
        assert held == pytest.approx([-1e-3] * 4)
        turn = euler("z", 0.4).inv() if upper is not SLAB else LEVEL
        middle = [0.1, -0.05, 0.0] if upper is not SLAB else [0.0, 0.0, 0.0]
        assert np.abs(turn.apply(points - middle))[:, :2] == pytest.approx(np.broadcast_to([0.05, 0.04], (4, 2)), abs=1e-5)

    def test_bricks(self):
        """Half over each other, sides flush."""
        brick = box(0.2, 0.1, 0.05)
        held, _, points = carrying(two(brick, np.array([0.2, 0.0, 0.099]), LEVEL, brick))
        assert held == pytest.approx([-1e-3] * 4)
        assert sorted(map(tuple, np.round(points[:, :2], 4).tolist())) == [(0.0, -0.1), (0.0, 0.1), (0.2, -0.1), (0.2, 0.1)]

    @pytest.mark.parametrize("angle", [0.3, 1.0, 0.5 * np.pi])
    def test_planks_across(self, angle):
        held, _, points = carrying(two(PLANK, np.array([0.0, 0.0, 0.099]), euler("z", angle), PLANK))
        assert held == pytest.approx([-1e-3] * 4)
        assert ConvexHull(points[:, :2]).volume == pytest.approx(0.01 / math.sin(angle), rel=1e-3)

    @pytest.mark.parametrize("length", [0.1, 0.6])
    def test_edge_on_face(self, length):
        """Two points: where the edge ends, or the face."""
        ridge = box(length, 0.1, 0.1)
        held, normals, points = carrying(
            two(ridge, np.array([0.0, 0.0, 0.1 + 0.1 * math.sqrt(2.0) - 1e-3]), euler("ZX", [0.3, 0.25 * np.pi]), SLAB)
        )
        assert held == pytest.approx([-1e-3] * 2)
        assert normals == pytest.approx(np.broadcast_to([0.0, 0.0, 1.0], (2, 3)), abs=1e-9)
        reach = min(length, 0.3 / math.cos(0.3))
        assert np.sort(points[:, 0]) == pytest.approx([-reach * math.cos(0.3), reach * math.cos(0.3)], abs=1e-5)

    @pytest.mark.parametrize("angle", [0.3, 1.0, 0.5 * np.pi])
    @pytest.mark.parametrize("gap", [-1e-3, 1e-2])
    def test_edge_across_edge(self, angle, gap):
        """One point where they cross, and the normal that is square to both."""
        ridge = box(0.4, 0.1, 0.1)
        touches = two(
            ridge,
            np.array([0.02, 0.03, 0.2 * math.sqrt(2.0) + gap]),
            euler("ZX", [angle, 0.25 * np.pi]),
            ridge,
            euler("x", 0.25 * np.pi),
        )
        k = int(np.argmin(sizes(touches)))
        assert sizes(touches)[k] == pytest.approx(gap, abs=1e-5)
        assert stacked(touches, "normal")[k] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
        expected = [0.02 - 0.03 / math.tan(angle), 0.0, 0.1 * math.sqrt(2.0) + 0.5 * gap]
        assert stacked(touches, "point")[k] == pytest.approx(expected, abs=1e-5)

    def test_corner_on_face(self):
        diagonal, _ = Rotation.align_vectors([[0.0, 0.0, -1.0]], [[1.0, 1.0, 1.0]])
        held, normals, points = carrying(two(CUBE, np.array([0.05, 0.02, 0.1 + 0.1 * math.sqrt(3.0) - 1e-3]), diagonal, SLAB))
        assert held == pytest.approx([-1e-3])
        assert normals[0] == pytest.approx([0.0, 0.0, 1.0])
        assert points[0] == pytest.approx([0.05, 0.02, 0.0995])

    def test_apex_of_a_blunt_pyramid(self):
        """The lowest point is told, be it ever so little lower than the others."""
        for height in (1e-4, 1e-3, 1e-2):
            blunt = polyhedron([*((x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.1, 0.1)), (0, 0, -height), (0, 0, 0.1)])[1]
            low = min(v[2] for v in blunt.vertices)
            touches = two(blunt, np.array([0.0, 0.0, 0.1 - low - 5e-5]), LEVEL, SLAB)
            assert sizes(touches).min() == pytest.approx(-5e-5, abs=1.1e-5)

    @pytest.mark.parametrize("yaw", [0.0, 0.3, 0.7])
    @pytest.mark.parametrize("tilt", [1e-7, 1e-5])
    def test_slots_stay(self, yaw, tilt):
        """However a body trembles that rests on another, every slot keeps its place."""
        way = np.linspace(0.0, 6.0, 60)
        tremble = Rotation.from_rotvec(tilt * np.column_stack([np.cos(way), np.sin(way), np.sin(3.0 * way)]))
        center = np.array([0.02, 0.01, 0.199]) + tilt * np.column_stack(
            [np.cos(2.0 * way), np.sin(5.0 * way), np.cos(7.0 * way)]
        )
        for upper in (CUBE, prism(6, 0.1, 0.1)):
            touches = hull_hull(
                shape("hull", upper, center, tremble * euler("z", yaw)),
                shape("hull", CUBE, np.zeros((60, 3)), Rotation.identity(60)),
            )
            assert (there(touches) == there(touches)[:, :1]).all()
            points = stacked(touches, "point")[there(touches)[:, 0]]
            assert np.abs(points - points[:, :1]).max() < 30.0 * tilt + 3e-6

    def test_order_does_not_matter(self):
        """Who is first decides which four points are told, but not how deep the deepest is."""
        rng = np.random.default_rng(7)
        a = shape("hull", WEDGE, rng.normal(scale=0.2, size=(200, 3)), Rotation.random(200, rng))
        b = shape("hull", rock(8), np.zeros((200, 3)), Rotation.random(200, rng))
        one, other = hull_hull(a, b), hull_hull(b, a)
        assert sizes(one).min(axis=0) == pytest.approx(sizes(other).min(axis=0), abs=5e-6)
        assert stacked(one, "normal")[0] == pytest.approx(-stacked(other, "normal")[0], abs=1e-6)

    def test_tilts(self):
        """Four corners while a cube tilts a little, then the lowest edge or corner; the lowest of all is always told."""
        tilt = np.geomspace(1e-6, 0.7, 80)
        for way in ([1.0, 0.0, 0.0], [0.6, 0.8, 0.0]):
            turn = Rotation.from_rotvec(np.outer(tilt, way))
            low = np.array([corners(CUBE, np.zeros(3), R)[:, 2].min() for R in turn.as_matrix()])
            touches = hull_hull(
                shape("hull", CUBE, np.column_stack([0.0 * low, 0.0 * low, 0.1 - low - 1e-4]), turn),
                shape("hull", SLAB, np.zeros((80, 3)), Rotation.identity(80)),
            )
            assert sizes(touches).min(axis=0) == pytest.approx(-1e-4, abs=1e-9)
            assert (there(touches).sum(axis=0)[tilt < 0.01] == 4).all()


def common(a, b, offset, yaw):
    """Area of what two prisms have in common, seen from above: by counting points."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-0.3, 0.3, (4000, 2))
    inside = np.ones(4000, bool)
    for solid, middle, angle in ((a, offset, yaw), (b, [0.0, 0.0], 0.0)):
        rows = halfspaces(solid, [*middle, 0.0], euler("z", angle).as_matrix())
        rows = rows[np.abs(rows[:, 2]) < 0.1]
        inside &= (x @ rows[:, :2].T <= rows[:, 3]).all(axis=1)
    return 0.36 * inside.mean()
