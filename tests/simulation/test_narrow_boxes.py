"""Boxes against balls, capsules and boxes: independent distances, symmetry, resting on faces, edges and corners, no flicker."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from articulated.compiler import Array, Program, compiled
from articulated.simulation.contact.narrow.boxes import block_block, rod_block
from articulated.simulation.contact.narrow.placed import FAR, Block, Rod
from articulated.spatial import Mat3, Vec3

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
CUBE, BRICK, SLAB, PLANK = (0.1, 0.1, 0.1), (0.3, 0.4, 0.5), (0.3, 0.4, 0.1), (0.5, 0.05, 0.02)
DEEP = 1e-4
"""About as deep as things rest in each other [m]."""


def vectors(x) -> Vec3:
    return Vec3(*np.moveaxis(np.asarray(x, dtype=float), -1, 0))


def block(position, turn, half) -> Block:
    """Boxes that stand somewhere; one number a state, or floats if there is one state."""
    R = turn.as_matrix() if isinstance(turn, Rotation) else turn
    return Block(vectors(position), Mat3(*(vectors(R[..., i, :]) for i in range(3))), half)


def rod(position, half, radius) -> Rod:
    return Rod(vectors(position), None if half is None else vectors(half), radius)


def arrays(touches, n):
    """Sizes (n, points), normals and points (n, points, 3)."""

    def stacked(numbers):
        return np.stack([np.broadcast_to(x, (n,)) for x in numbers], -1)

    normals = np.stack([stacked(touch.normal) for touch in touches], 1)
    return stacked([touch.size for touch in touches]), normals, np.stack([stacked(touch.point) for touch in touches], 1)


def inside(x, position, R, half):
    """How far points (n, k, 3) are outside of boxes, or, if negative, inside."""
    return (np.abs(np.einsum("nij,nki->nkj", R, x - position[:, None])) - half).max(-1)


def separation(A, a, B, b, apart):
    """Of boxes turned by A and B: by each of the 15 axes, (n, 15), from their corners; -9 for edges that are parallel but for 1e-3 rad."""
    crossed = np.cross(np.moveaxis(A, -1, 1)[:, :, None], np.moveaxis(B, -1, 1)[:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([np.moveaxis(A, -1, 1), np.moveaxis(B, -1, 1), crossed], axis=1)
    length = np.linalg.norm(axes, axis=-1)
    axes = axes / np.maximum(length, 1e-9)[..., None]
    p = np.einsum("nlk,nck->nlc", axes, apart[:, None] + np.einsum("nij,cj->nci", A, CORNERS * a))
    q = np.einsum("nlk,nck->nlc", axes, np.einsum("nij,cj->nci", B, CORNERS * b))
    return np.where(length > 1e-3, np.maximum(p.min(-1) - q.max(-1), q.min(-1) - p.max(-1)), -9.0)


def near(rng, A, a, B, b, gap, direction=None):
    """Where a has to stand about b, along random directions, for the two to be so far apart."""
    n = len(A)
    direction = rng.normal(size=(n, 3)) if direction is None else direction
    low, high = np.zeros(n), np.full(n, 3.0 / np.linalg.norm(direction, axis=1))
    for _ in range(40):
        middle = 0.5 * (low + high)
        wider = separation(A, a, B, b, direction * middle[:, None]).max(1) > gap
        low, high = np.where(wider, low, middle), np.where(wider, middle, high)
    return direction * high[:, None]


def convex_distance(center, columns):
    """The least length of center + columns x, |x| ≤ 1: a convex quadratic program."""
    return np.linalg.norm(center + columns @ lsq_linear(columns, -center, (-1.0, 1.0), tol=1e-14).x)


def area(points):
    return ConvexHull(points).volume if len(points) > 2 else 0.0


def overlap(quad, half):
    """What of a polygon lies in a rectangle: Sutherland and Hodgman, corner by corner."""
    for axis, side in itertools.product((0, 1), (-1.0, 1.0)):
        kept = []
        for p, q in zip(quad, [*quad[1:], *quad[:1]], strict=True):
            dp, dq = half[axis] - side * p[axis], half[axis] - side * q[axis]
            kept += [p] if dp >= 0.0 else []
            kept += [p + (q - p) * (dp / (dp - dq))] if dp * dq < 0.0 else []
        quad = kept
    return np.array(quad)


def stacked(rng, below, above, tilt=0.0, offset=0.0, yaw=None, n=100, swapped=False):
    """Boxes on others whose top is z = 0: their points, and what of their lowest face is over it, (corners, 3) each."""
    yaw = rng.uniform(0.0, 2.0 * np.pi, n) if yaw is None else np.full(n, yaw)
    way = rng.uniform(0.0, 2.0 * np.pi, n)
    lean = Rotation.from_rotvec(tilt * np.column_stack([np.cos(way), np.sin(way), 0.0 * way]))
    turn = lean * Rotation.from_rotvec(np.outer(yaw, [0.0, 0.0, 1.0]))
    corners = np.einsum("nij,cj->nci", turn.as_matrix(), CORNERS * above)
    position = np.column_stack([*rng.uniform(-offset, offset, (2, n)), -corners[..., 2].min(1) - DEEP])
    ground = block(np.broadcast_to([0.0, 0.0, -below[2]], (n, 3)), Rotation.identity(n), below)
    upper = block(position, turn, above)
    found = arrays(block_block(ground, upper) if swapped else block_block(upper, ground), n)
    faces = [(corners[k] + position[k])[np.argsort(corners[k, :, 2])[:4]] for k in range(n)]
    faces = [face[ConvexHull(face[:, :2]).vertices] for face in faces]
    return *found, [overlap(list(face), below[:2]) for face in faces]


class TestBall:
    def test_distance(self, rng):
        n, radius = 2000, 0.05
        turn, center, p = Rotation.random(n, rng=rng), rng.normal(size=(n, 3)), rng.normal(size=(n, 3)) * 0.5
        sizes, normals, points = arrays(rod_block(rod(center + turn.apply(p), None, radius), block(center, turn, BRICK)), n)
        beyond = np.abs(p) - BRICK
        is_in = beyond.max(1) < 0.0
        assert 100 < is_in.sum() < n - 100
        np.testing.assert_allclose(sizes[is_in, 0], beyond[is_in].max(1) - radius, atol=1e-12)
        np.testing.assert_allclose(
            sizes[~is_in, 0], np.linalg.norm(np.maximum(beyond, 0.0), axis=1)[~is_in] - radius, atol=1e-12
        )
        surface = points - 0.5 * sizes[..., None] * normals
        np.testing.assert_allclose(inside(surface, center, turn.as_matrix(), BRICK), 0.0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-12)
        np.testing.assert_allclose(
            surface + (sizes[..., None] + radius) * normals, (center + turn.apply(p))[:, None], atol=1e-12
        )


CAPSULE = 0.05
"""Radius of capsules [m]."""
Z = BRICK[2] + CAPSULE - DEEP
LYING = {  # where, along what; where it touches besides the middle of that
    "on the face": ((0.05, 0.1, Z), (0.0, 0.2, 0.0), [0.05, -0.1], [0.05, 0.3]),
    "across": ((0.05, 0.1, Z), (0.8, 0.0, 0.0), [-0.3, 0.1], [0.3, 0.1]),
    "over one side": ((0.05, 0.1, Z), (0.0, 0.4, 0.0), [0.05, -0.3], [0.05, 0.4]),
    "obliquely": ((0.0, 0.1, Z), (0.5, 0.5, 0.0), [-0.3, -0.2], [0.3, 0.4]),
    "over an edge": ((0.3, 0.1, Z), (0.0, 0.2, 0.0), [0.3, -0.1], [0.3, 0.3]),
}


class TestCapsule:
    def lying(self, p, d, noise=0.0, n=1, rng=None):
        shake = [np.zeros((n, 3)) if rng is None else noise * rng.normal(size=(n, 3)) for _ in range(4)]
        capsule = rod(np.asarray(p) + shake[0], np.asarray(d) + shake[1], CAPSULE)
        return arrays(rod_block(capsule, block(shake[2], Rotation.from_rotvec(shake[3]), BRICK)), n)

    @pytest.mark.parametrize("slope", [None, 0.0, 1e-7, 1e-4, 1e-3, 1e-2])
    def test_distance(self, rng, slope):
        """In general, and where lines are level with faces, or almost."""
        n = 200
        turn, center, p = Rotation.random(n, rng=rng), rng.normal(size=(n, 3)), rng.normal(size=(n, 3)) * 0.7
        d = 0.3 * rng.normal(size=(n, 3))
        if slope is not None:
            d = 0.4 * np.eye(3)[rng.integers(3, size=n)] + slope * d
        capsule = rod(center + turn.apply(p), turn.apply(d), CAPSULE)
        sizes, normals, points = arrays(rod_block(capsule, block(center, turn, BRICK)), n)
        truth = np.array([convex_distance(p[k], np.column_stack([d[k], -np.diag(BRICK)])) for k in range(n)])
        apart = truth > 1e-6
        assert apart.sum() > 100
        np.testing.assert_allclose((sizes.min(1) + CAPSULE)[apart], truth[apart], atol=5e-7)
        np.testing.assert_allclose((sizes[:, 0] + CAPSULE)[apart], truth[apart], atol=5e-4)
        assert (sizes[~apart, 0] < 1e-6 - CAPSULE).all()
        np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-12)
        # each point is between the surfaces
        surface = points - 0.5 * sizes[..., None] * normals
        assert np.abs(inside(surface, center, turn.as_matrix(), BRICK))[apart].max() < 1e-6
        axis = points + (0.5 * sizes[..., None] + CAPSULE) * normals - center[:, None]
        axis = np.einsum("nij,nki->nkj", turn.as_matrix(), axis) - p[:, None]
        t = np.einsum("nki,ni->nk", axis, d) / np.einsum("ni,ni->n", d, d)[:, None]
        np.testing.assert_allclose(axis, t[..., None] * d[:, None], atol=1e-9)
        assert np.abs(t).max() < 1.0 + 1e-9

    @pytest.mark.parametrize("name", LYING)
    def test_rests_on_two_points_and_the_middle(self, name, rng):
        p, d, first, second = LYING[name]
        sizes, normals, points = self.lying(p, d, 1e-6, 300, rng)
        np.testing.assert_allclose(sizes, -DEEP, atol=1e-5)
        np.testing.assert_allclose(normals, np.broadcast_to([0.0, 0.0, 1.0], normals.shape), atol=2e-4)
        expected = np.array([0.5 * np.add(first, second), first, second])
        np.testing.assert_allclose(points[..., :2], np.broadcast_to(expected, (300, 3, 2)), atol=1.5e-5)

    @pytest.mark.parametrize(("half", "end"), [(0.2, 0.3), (0.8, 0.4)])
    def test_lies_along_an_edge(self, half, end, rng):
        """Beside both faces: one point would let it seesaw."""
        out = (CAPSULE - DEEP) * np.sqrt(0.5)
        sizes, normals, points = self.lying((0.3 + out, 0.1, 0.5 + out), (0.0, half, 0.0), 1e-6, 300, rng)
        np.testing.assert_allclose(sizes, -DEEP, atol=1e-5)
        np.testing.assert_allclose(normals, np.broadcast_to([np.sqrt(0.5), 0.0, np.sqrt(0.5)], normals.shape), atol=3e-4)
        np.testing.assert_allclose(
            np.sort(points[:, 1:, 1]), np.broadcast_to([-min(half - 0.1, 0.4), end], (300, 2)), atol=1e-5
        )

    def test_sunk_in_leaves_by_one_face(self):
        """Also where its line is in the box: so do its ends, though one of them is at a side of the box."""
        for p, d in (((0.05, 0.1, 0.48), (0.0, 0.2, 0.0)), ((0.05, 0.1, 0.48), (0.0, 0.8, 0.0))):
            sizes, normals, _ = self.lying(p, d)
            np.testing.assert_allclose(sizes, -0.02 - CAPSULE, atol=1e-12)
            np.testing.assert_allclose(normals, np.broadcast_to([0.0, 0.0, 1.0], (1, 3, 3)), atol=1e-12)
        sizes, normals, _ = self.lying((0.05, 0.1, 0.6), (0.0, 0.02, 0.2))
        np.testing.assert_allclose(normals, np.broadcast_to([0.0, 0.0, 1.0], (1, 3, 3)), atol=1e-12)
        assert sizes.min() == pytest.approx(-0.1 - CAPSULE)
        assert sizes.max() == pytest.approx(0.3 - CAPSULE)


class TestDistanceOfBoxes:
    @pytest.mark.parametrize(("a", "b"), [(BRICK, (0.2, 0.3, 0.7)), (CUBE, CUBE), (SLAB, PLANK)])
    @pytest.mark.parametrize("tilt", [3.0, 0.3, 0.03, 0.001])
    @pytest.mark.parametrize("gap", [-0.01, -0.001, 0.001, 0.01])
    def test_near(self, rng, a, b, tilt, gap):
        """Each pair is as far apart as corners on 15 axes say, or what a quadratic program says."""
        n = 150
        A = Rotation.random(n, rng=rng)
        yaw = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.3, n), [0.0, 0.0, 1.0]))
        B = (A * Rotation.from_rotvec(tilt * rng.normal(size=(n, 3))) * yaw).as_matrix()
        A = A.as_matrix()
        apart = near(rng, A, a, B, b, gap)
        b_center = rng.normal(size=(n, 3))
        sizes, normals, _ = arrays(block_block(block(b_center + apart, A, a), block(b_center, B, b)), n)
        best = separation(A, a, B, b, apart).max(1)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-9)
        # what is given up: a tenth of a millimetre, and what a face is tilted to edges that it stands for, 2%
        lost = sizes.min(1) - best
        assert lost.min() > -1.2e-4 - 0.02 * abs(gap)
        assert np.quantile(lost, 0.95) < 1e-4 + 0.02 * abs(gap)
        assert np.mean(sizes.min(1) * gap > 0.0) >= (1.0 if gap > 0.0 else 0.98)
        if gap > 0.0:
            for k in range(0, n, 15):
                truth = convex_distance(apart[k], np.column_stack([A[k] * a, -B[k] * b]))
                assert -1.2e-4 - 0.3 * gap < sizes[k].min() - truth < 1e-3 + 0.5 * gap

    def test_points_are_between_the_surfaces(self, rng):
        n = 2000
        A, B = (Rotation.random(n, rng=rng).as_matrix() for _ in range(2))
        a, b = BRICK, (0.2, 0.3, 0.7)
        apart = near(rng, A, a, B, b, -0.01)
        sizes, normals, points = arrays(block_block(block(apart, A, a), block(0.0 * apart, B, b)), n)
        half = np.where(sizes < FAR, 0.5 * sizes, 0.0)[..., None] * normals
        for surface, position, R, h in ((points + half, apart, A, a), (points - half, 0.0 * apart, B, b)):
            there = inside(surface, position, R, h)[sizes < FAR]
            assert there.max() < 1e-5
            assert there.min() > -1e-5
        assert {1, 3, 4} == set((sizes < FAR).sum(1))

    def test_far(self, rng):
        """No nearer than they are; where no part of a face is over the other, the lowest corner alone stands for it."""
        n = 2000
        A, B = (Rotation.random(n, rng=rng).as_matrix() for _ in range(2))
        apart = near(rng, A, BRICK, B, SLAB, 0.2)
        sizes, normals, _ = arrays(block_block(block(apart, A, BRICK), block(0.0 * apart, B, SLAB)), n)
        best = separation(A, BRICK, B, SLAB, apart)
        assert sizes.min() > 0.2 * 0.98 - 1e-4
        one, count = sizes.min(1), (sizes < FAR).sum(1)
        assert set(count) == {1, 3, 4}
        by_face = (
            np.abs(np.concatenate([np.einsum("nij,ni->nj", R, normals[:, 0]) for R in (A, B)], axis=1)).max(1) > 1.0 - 1e-12
        )
        alone = by_face & (count == 1)
        assert alone.sum() > 20
        np.testing.assert_allclose(one[alone], best[alone, :6].max(1), atol=1e-4)

    def test_what_overlaps_deeply_is_pushed_out(self, rng):
        n = 2000
        A, B = (Rotation.random(n, rng=rng).as_matrix() for _ in range(2))
        apart = 0.2 * rng.normal(size=(n, 3))
        sizes, normals, _ = arrays(block_block(block(apart, A, BRICK), block(0.0 * apart, B, SLAB)), n)
        best = separation(A, BRICK, B, SLAB, apart).max(1)
        deep = best < 0.0
        assert deep.sum() > 1000
        np.testing.assert_allclose(sizes.min(1)[deep], best[deep], rtol=0.02, atol=2e-3)
        out = apart - normals[:, 0] * (sizes.min(1) - 1e-9)[:, None]
        assert (separation(A, BRICK, B, SLAB, out).max(1) > -2e-3 - 0.02 * np.abs(best))[deep].all()

    def test_swapped_and_moved(self, rng):
        """Swapped, normals turn round; moved together, all moves. A near tie may be decided otherwise: lengths are the same then."""
        n = 2000
        A, B, turn = (Rotation.random(n, rng=rng) for _ in range(3))
        apart, move = 0.4 * rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
        a, b = block(apart, A, BRICK), block(0.0 * apart, B, SLAB)
        a_moved, b_moved = block(move + turn.apply(apart), turn * A, BRICK), block(move, turn * B, SLAB)
        sizes, normals, points = arrays(block_block(a, b), n)
        swapped = arrays(block_block(b, a), n)
        moved = arrays(block_block(a_moved, b_moved), n)
        back = [np.einsum("nij,nki->nkj", turn.as_matrix(), x) for x in (moved[1], moved[2] - move[:, None])]
        for other in ((swapped[0], -swapped[1], swapped[2]), (moved[0], *back)):
            same = np.abs(other[1] - normals).max((1, 2)) < 1e-9
            assert same.mean() > 0.995
            np.testing.assert_allclose(other[0][same], sizes[same], atol=1e-9)
            there = (sizes < FAR) & same[:, None]
            np.testing.assert_allclose(other[2][there], points[there], atol=1e-9)
            np.testing.assert_allclose(other[0].min(1), sizes.min(1), atol=3e-4, rtol=0.02)


class TestRestingBoxes:
    @pytest.mark.parametrize("offset", [(0.0, 0.0), (0.05, 0.03), (0.1, -0.1), (-0.15, 0.0)])
    def test_aligned(self, offset):
        """The corners of what overlaps, in either order."""
        upper, lower = ([*offset, 0.2 - DEEP], CUBE), ([0.0, 0.0, 0.0], CUBE)
        for (p, a), (q, b), sign in ((upper, lower, 1.0), (lower, upper, -1.0)):
            touches = block_block(block(p, np.eye(3), a), block(q, np.eye(3), b))
            sizes, normals, points = arrays(touches, 1)
            np.testing.assert_allclose(sizes, -DEEP, atol=1e-12)
            np.testing.assert_allclose(normals[0], [[0.0, 0.0, sign]] * 4, atol=1e-12)
            bounds = [(max(-0.1, x - 0.1), min(0.1, x + 0.1)) for x in offset]
            expected = sorted((x, y, 0.1 - 0.5 * DEEP) for x in bounds[0] for y in bounds[1])
            np.testing.assert_allclose(sorted(points[0].round(9).tolist()), expected, atol=1e-6)

    @pytest.mark.parametrize(("below", "above", "offset", "least"), [(CUBE, CUBE, 0.03, 0.6), (SLAB, CUBE, 0.1, 0.999), (CUBE, SLAB, 0.1, 0.999), (PLANK, PLANK, 0.0, 0.65)])  # fmt: skip
    def test_turned_any_way(self, rng, below, above, offset, least):
        """Four points that are far from each other: their area is much of what overlaps, all of it if that has four corners."""
        sizes, _, points, faces = stacked(rng, below, above, offset=offset)
        np.testing.assert_allclose(sizes, -DEEP, atol=1e-9)
        for four, face in zip(points, faces, strict=True):
            part = area(four[:, :2]) / area(face[:, :2])
            assert least < part < 1.00001
            assert part > 0.999 or len(face) > 4

    def test_overhanging(self, rng):
        """Four points unless what overlaps is a triangle; then three."""
        counts = set()
        for below, above in ((CUBE, CUBE), (PLANK, CUBE), (SLAB, PLANK)):
            sizes, _, points, faces = stacked(rng, below, above, offset=0.3, n=400)
            for size, point, face in zip(sizes, points, faces, strict=True):
                if len(face) < 3 or ConvexHull(face[:, :2]).volume < 1e-4:
                    continue
                sides = np.linalg.norm(face - np.roll(face, 1, axis=0), axis=1)
                corners, count = int((sides > 1e-3).sum()), int((size < FAR).sum())
                counts.add(corners)
                assert count == min(corners, 4) or sides.min() < 0.02
                assert area(point[size < FAR][:, :2]) > (0.5 if corners > 4 else 0.98) * area(face[:, :2])
        assert counts >= {3, 4, 5, 6}

    @pytest.mark.parametrize("swapped", [False, True])
    @pytest.mark.parametrize("tilt", [1e-5, 1e-3, 3e-3, 0.01, 0.1, 0.5])
    def test_a_small_box_leans(self, rng, tilt, swapped):
        """All four corners of its face are there, so also the lowest, whichever box comes first."""
        sizes, normals, points, faces = stacked(rng, SLAB, (0.05, 0.07, 0.06), tilt, 0.1, swapped=swapped)
        for size, normal, point, face in zip(sizes, normals, points, faces, strict=True):
            corners = point + (-0.5 if swapped else 0.5) * size[:, None] * normal
            distances = np.linalg.norm(corners[:, None] - face, axis=-1)
            assert distances.min(0).max() < 1e-5 + 0.5 * tilt * DEEP
            assert size.min() == pytest.approx(-DEEP, abs=0.2 * DEEP)

    @pytest.mark.parametrize("tilt", [1e-3, 3e-3, 0.01, 0.03, 0.1])
    def test_the_lowest_of_many_corners_is_there(self, rng, tilt):
        """Or one that is as low up to what it is away, in 400 parts."""
        sizes, _, _, faces = stacked(rng, CUBE, CUBE, tilt, yaw=0.7)
        for size, face in zip(sizes, faces, strict=True):
            assert len(face) > 4
            assert size.min() < face[:, 2].min() + 0.3 / 400
            assert (size < FAR).sum() == 4

    def test_on_an_edge_and_on_a_corner(self, rng):
        """On its edge a box has two points at the same depth, on its corner one; others are as high as its corners are."""
        for axes, deep in (([[1.0, 1.0, 0.0]], 2), ([[1.0, 1.0, 1.0]], 1)):
            turn = Rotation.align_vectors([[0.0, 0.0, 1.0]], axes)[0]
            height = 0.1 * np.linalg.norm(axes) - DEEP
            sizes, normals, points = arrays(
                block_block(block([0.0, 0.0, height], turn, CUBE), block([0.0, 0.0, -0.1], np.eye(3), SLAB)), 1
            )
            np.testing.assert_allclose(np.sort(sizes[0])[:deep], -DEEP, atol=1e-9)
            assert np.sort(sizes[0])[deep] > 0.05
            np.testing.assert_allclose(normals[0], [[0.0, 0.0, 1.0]] * 4, atol=1e-9)
            low = points[0][sizes[0] < 0.0]
            assert np.linalg.norm(np.ptp(low, axis=0)) == pytest.approx(0.2 * (deep - 1), abs=1e-6)

    @pytest.mark.parametrize("gap", [-0.01, -1e-6, 0.01])
    def test_edges_cross(self, gap):
        """Two boxes that stand on edges, one on the other."""
        a, b = Rotation.from_rotvec([0.25 * np.pi, 0.0, 0.0]), Rotation.from_rotvec([0.0, 0.25 * np.pi, 0.0])
        top = block([0.02, 0.03, 0.2 * np.sqrt(2.0) + gap], a, CUBE)
        sizes, normals, points = arrays(block_block(top, block([0.0, 0.0, 0.0], b, CUBE)), 1)
        np.testing.assert_allclose(sizes[0], [gap, FAR, FAR, FAR], atol=1e-12)
        np.testing.assert_allclose(normals[0, 0], [0.0, 0.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(points[0, 0], [0.0, 0.03, 0.1 * np.sqrt(2.0) + 0.5 * gap], atol=1e-12)

    def test_planks_across_each_other_keep_their_points(self, rng):
        """Leaning a little, it is edges that separate them, of which each crossing is a point; far ends are not in the way."""
        sizes, _, points, faces = stacked(rng, PLANK, PLANK, 0.02, offset=0.02, yaw=1.2)
        for size, point, face in zip(sizes, points, faces, strict=True):
            assert (size < FAR).sum() == 4
            assert area(point[:, :2]) / area(face[:, :2]) > 0.99
            assert size.min() == pytest.approx(face[:, 2].min(), abs=1e-4)


STANDING = {
    "cubes": (CUBE, CUBE, (0.0, 0.0, 0.2 - DEEP), 0.0),
    "cubes just touch": (CUBE, CUBE, (0.0, 0.0, 0.2), 0.0),
    "half over": (CUBE, CUBE, (0.1, 0.1, 0.2 - DEEP), 0.0),
    "flush": (SLAB, CUBE, (0.2, 0.0, 0.2 - DEEP), 0.0),
    "small on large": (SLAB, CUBE, (0.05, 0.0, 0.2 - DEEP), 20.0),
    "large on small": (CUBE, SLAB, (0.05, 0.02, 0.2 - DEEP), 30.0),
    "planks": (PLANK, PLANK, (0.0, 0.0, 0.04 - DEEP), 45.0),
    **{f"turned {angle}": (CUBE, CUBE, (0.0, 0.0, 0.2 - DEEP), angle) for angle in (15.0, 22.5, 30.0, 45.0, 60.0, 67.5, 90.0)},
}


@pytest.mark.parametrize("noise", [1e-7, 1e-6])
@pytest.mark.parametrize("name", STANDING)
def test_points_do_not_flicker(name, noise, rng):
    """Each slot keeps its point, whatever the noise: friction is anchored there."""
    below, above, position, angle = STANDING[name]
    n, turn = 500, Rotation.from_rotvec([0.0, 0.0, np.radians(angle)])
    shake = [noise * rng.normal(size=(n, 3)) for _ in range(4)]
    upper = block(position + shake[0], Rotation.from_rotvec(shake[1]) * turn, above)
    sizes, normals, points = arrays(block_block(upper, block(shake[2], Rotation.from_rotvec(shake[3]), below)), n)
    for x in (sizes, normals, points):
        assert np.ptp(x, axis=0).max() < 20.0 * noise


def numbers(touches):
    return [x for touch in touches for x in (touch.size, *touch.normal, *touch.point)]


def meetings(x):
    """A ball and a capsule on a box, a box on a box, from 39 numbers: two positions, two rotations, lines and a box of the world."""
    p, q, d = (Vec3(*x[k : k + 3]) for k in (0, 3, 6))
    R, S = (Mat3(*(Vec3(*x[k + 3 * i : k + 3 * i + 3]) for i in range(3))) for k in (9, 18))
    a, b, fixed = Block(p, R, BRICK), Block(q, S, SLAB), Block(Vec3(0.1, 0.0, -0.2), Mat3.identity(), BRICK)
    touches = [*block_block(a, b), *block_block(a, fixed)]
    touches += [touch for other in (a, fixed) for half in (None, d) for touch in rod_block(Rod(q, half, 0.1), other)]
    return numbers(touches)


def test_floats_arrays_and_machine_code_agree(rng):
    n = 300
    turns = [Rotation.random(n, rng=rng).as_matrix() for _ in range(2)]
    turns = [np.where(np.arange(n)[:, None, None] % 3 == 0, np.eye(3), R) for R in turns]  # with many ties
    x = np.column_stack([rng.normal(size=(n, 9)) * 0.4, *(R.reshape(n, 9) for R in turns)])
    batch = np.column_stack([np.broadcast_to(column, (n,)) for column in meetings(list(x.T))])
    assert np.isfinite(batch).all()
    floats = np.array([meetings(row) for row in x[:100].tolist()])
    np.testing.assert_array_equal(floats, batch[:100])
    size = batch.shape[1]
    program = Program("boxes", b"", (Array("x", (27,)),), (Array("y", (size,)),), lambda _, x: [meetings(x)])
    for single, atol in ((False, 1e-11), (True, 2e-4)):
        states, result = (np.ascontiguousarray(y, np.float32 if single else float) for y in (x, np.empty_like(batch)))
        kernel = compiled(program, single)
        kernel([(states, states.strides[0], 0, None), (result, result.strides[0], 0, None)], n, 1)
        assert np.isfinite(result).all()
        of_touches = np.abs(result - batch).reshape(n, -1, 7)
        there = (batch.reshape(n, -1, 7)[..., :1] < FAR) | (np.arange(7) < 4)  # nobody asks where a point is that is far
        assert (of_touches * there).max() < atol
