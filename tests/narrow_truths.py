"""Poses for pairs of shapes, and what other programs know of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from scipy.spatial.transform import Rotation

from articulated.compiler import Array, Program, compiled
from articulated.scalar import Scalar
from articulated.simulation.contact.narrow.placed import Block, Hull, Rod, Roller
from articulated.simulation.contact.narrow.solids import Polyhedron, Solid
from articulated.simulation.contact.polyhedra import polyhedron
from articulated.spatial import Mat3, Vec3

LEVEL = Rotation.identity()


def box(x, y, z) -> Polyhedron:
    return polyhedron([(i * x, j * y, k * z) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])[1]


def prism(n, radius, half) -> Polyhedron:
    angles = 2.0 * np.pi * np.arange(n) / n
    return polyhedron([(radius * np.cos(a), radius * np.sin(a), z) for a in angles for z in (-half, half)])[1]


def rock(n, seed=0, half=(0.3, 0.2, 0.15)) -> Polyhedron:
    """Points on an ellipsoid: all faces are triangles."""
    points = np.random.default_rng(seed).normal(size=(n, 3))
    return polyhedron(points / np.linalg.norm(points, axis=1)[:, None] * half)[1]


CUBE, PLANK, SLAB = box(0.1, 0.1, 0.1), box(0.4, 0.05, 0.05), box(0.3, 0.3, 0.1)
WEDGE = polyhedron([(-0.2, -0.1, 0), (0.2, -0.1, 0), (-0.2, 0.1, 0), (0.2, 0.1, 0), (-0.1, 0, 0.15), (0.1, 0, 0.15)])[1]
SOLIDS = {"cube": CUBE, "plank": PLANK, "wedge": WEDGE, "rock of 8": rock(8), "rock of 12": rock(12)}
LIMB = rock(10, 2, (0.3, 0.06, 0.05))
NEEDLE = polyhedron([(-0.3, 0, 0), (0.3, 0, 0), (0, 0.03, 0), (0, -0.015, 0.026), (0, -0.015, -0.026)])[1]


def euler(axes, angles) -> Rotation:
    return Rotation.from_euler(axes, angles)


def lying(yaw=0.0, roll=0.0, camber=0.0) -> Rotation:
    """A cylinder whose axis is level: turned about z, its axis, and out of level."""
    angles = np.broadcast_arrays(yaw, 0.5 * np.pi + camber, roll)
    return Rotation.from_euler("ZYZ", np.stack(angles, axis=-1))


def vector(x) -> Vec3:
    """Of arrays whose last axis has three numbers."""
    return Vec3(*np.moveaxis(np.asarray(x, dtype=float), -1, 0))


def matrix(R) -> Mat3:
    R = np.asarray(R, dtype=float)
    return Mat3.of([[R[..., i, j] for j in range(3)] for i in range(3)])


def shape(kind, size, center, rotation: Rotation):
    """One shape in many poses."""
    R = rotation.as_matrix()
    if kind == "ball":
        return Rod(vector(center), None, *size)
    if kind == "capsule":
        radius, half = size
        return Rod(vector(center), vector(R[..., 2] * half), radius)
    if kind == "cylinder":
        return Roller(vector(center), vector(R[..., 2]), *size)
    if kind == "box":
        return Block(vector(center), matrix(R), tuple(size))
    return Hull(vector(center), matrix(R), Solid.of(size))


def sizes(touches) -> np.ndarray:
    """Gaps, a row for each touch."""
    return np.array(np.broadcast_arrays(*(touch.size for touch in touches)), dtype=float)


def stacked(touches, what) -> np.ndarray:
    """Normals or points of touches that are arrays: touch, state, component."""
    parts = [[np.broadcast_to(x, np.shape(sizes(touches))[1:]) for x in getattr(touch, what)] for touch in touches]
    return np.moveaxis(np.array(parts, dtype=float), 1, -1)


def there(touches) -> np.ndarray:
    return sizes(touches) < 100.0


def carrying(touches):
    """Gaps, normals and points of those that carry."""
    held = sizes(touches) < 0.0
    return sizes(touches)[held], stacked(touches, "normal")[held], stacked(touches, "point")[held]


def numbers(touches) -> list[Scalar]:
    return [x for touch in touches for x in (touch.size, *touch.normal, *touch.point)]


def rows(kind, size, center, rotation: Rotation) -> np.ndarray:
    """Shapes as numbers: middle, axes and sizes, shape (n, 5, 3)."""
    sizes = np.zeros(3)
    if kind != "hull":
        sizes[: len(size)] = size
    n = len(center)
    return np.concatenate([center[:, None], rotation.as_matrix(), np.broadcast_to(sizes, (n, 1, 3))], axis=1)


def from_rows(kind, size, numbers):
    """A shape of such numbers; only of a hull the size is a constant."""
    center, R, sizes = Vec3.of(numbers[0]), Mat3.of(numbers[1:4]), numbers[4]
    if kind == "hull":
        return Hull(center, R, Solid.of(size))
    if kind == "box":
        return Block(center, R, tuple(sizes))
    axis = R.column(2)
    if kind == "cylinder":
        return Roller(center, axis, sizes[0], sizes[1])
    return Rod(center, axis * sizes[1] if kind == "capsule" else None, sizes[0])


def check_all_ways(function, first, second, poses):
    """Floats and machine code, of both precisions, find what arrays do."""
    p, R, q, Q = poses
    n = len(p)
    expected = np.array([np.broadcast_to(x, n) for x in numbers(function(shape(*first, p, R), shape(*second, q, Q)))]).T
    inputs = [rows(*first, p, R), rows(*second, q, Q)]

    def meet(a, b):
        return numbers(function(from_rows(*first, a), from_rows(*second, b)))

    for k in range(20):
        alone = meet(inputs[0][k].tolist(), inputs[1][k].tolist())
        assert all(isinstance(x, float) for x in alone)
        np.testing.assert_allclose(alone, expected[k], rtol=1e-9, atol=1e-12)
    arguments, content = (Array("a", (5, 3)), Array("b", (5, 3))), repr((function.__name__, first, second)).encode()
    program = Program("pair", content, arguments, (Array("touches", expected.shape[1:]),), lambda _, a, b: [meet(a, b)])
    for single, tolerance in ((False, 1e-9), (True, 1e-4)):
        kind = np.float32 if single else float
        arrays = [*(x.astype(kind) for x in inputs), np.empty(expected.shape, kind)]
        compiled(program, single)([(x, x.strides[0], 0, None) for x in arrays], n, 1)
        assert np.isfinite(arrays[-1]).all()
        error = np.abs(arrays[-1] - expected).reshape(n, -1, 7)
        error[expected.reshape(n, -1, 7)[..., 0] > 100.0] = 0.0  # nobody asks where a point is that is far
        assert np.mean(error.max(axis=(1, 2)) < tolerance) > (0.97 if single else 0.999)


def random_poses(n):
    """Of two bodies near each other: centre and rotation of each."""
    rng = np.random.default_rng(7)
    return (
        rng.normal(scale=0.2, size=(n, 3)),
        Rotation.random(n, rng),
        rng.normal(scale=0.1, size=(n, 3)),
        Rotation.random(n, rng),
    )


TURN, SHIFT = Rotation.random(rng=np.random.default_rng(8)), np.array([1.0, -2.0, 0.5])


def moved_together(function, first, second, poses):
    """What is found of two bodies where they are, and if both are moved by TURN and SHIFT."""
    p, R, q, Q = poses
    here = function(shape(*first, p, R), shape(*second, q, Q))
    moves = ((TURN.apply(p) + SHIFT, TURN * R), (TURN.apply(q) + SHIFT, TURN * Q))
    return here, function(*(shape(*body, *move) for body, move in zip((first, second), moves, strict=True)))


def assert_same_touches(here, moved):
    """The same points and normals, moved with the bodies."""
    seen = there(here)
    assert (seen == there(moved)).all()
    assert TURN.apply(stacked(here, "normal")[seen]) == pytest.approx(stacked(moved, "normal")[seen], abs=1e-7)
    assert TURN.apply(stacked(here, "point")[seen]) + SHIFT == pytest.approx(stacked(moved, "point")[seen], abs=1e-7)


class Pair:
    """Two shapes, the second anywhere, and their distance as MuJoCo has it."""

    def __init__(self, first, second):
        import mujoco

        self.shapes, self._mujoco = (first, second), mujoco
        meshes = "".join(
            f'<mesh name="m{k}" vertex="{" ".join(repr(x) for v in size.vertices for x in v)}"/>'
            for k, (kind, size) in enumerate(self.shapes)
            if kind == "hull"
        )
        bodies = "".join(f'<body mocap="true"><geom {self._geom(k)}/></body>' for k in range(2))
        self._model = mujoco.MjModel.from_xml_string(f"<mujoco><asset>{meshes}</asset><worldbody>{bodies}</worldbody></mujoco>")
        self._data = mujoco.MjData(self._model)

    def _geom(self, k):
        kind, size = self.shapes[k]
        if kind == "hull":
            return f'type="mesh" mesh="m{k}"'
        name = {"ball": "sphere"}.get(kind, kind)
        return f'type="{name}" size="{" ".join(map(repr, size))}"'

    def distance(self, center, rotation: Rotation) -> np.ndarray:
        """Of the first at these places to the second in the middle; negative inside."""
        found = []
        for p, (x, y, z, w) in zip(center, rotation.as_quat(), strict=True):
            self._data.mocap_pos[0], self._data.mocap_quat[0] = p, (w, x, y, z)
            self._mujoco.mj_kinematics(self._model, self._data)
            found.append(self._mujoco.mj_geomDistance(self._model, self._data, 0, 1, 10.0, None))
        return np.array(found)

    def near(self, rng, count, width, reach=2.0):
        """Random poses in which they are less than this apart, or deep in each other; and their distances."""
        rotation, along = Rotation.random(count, rng), rng.normal(size=(count, 3))
        along /= np.linalg.norm(along, axis=1)[:, None]
        low, high = np.zeros(count), np.full(count, reach)
        for _ in range(9):
            middle = 0.5 * (low + high)
            overlap = self.distance(along * middle[:, None], rotation) < 0.0
            low, high = np.where(overlap, middle, low), np.where(overlap, high, middle)
        center = along * (high + rng.uniform(-width, width, count))[:, None]
        return center, rotation, self.distance(center, rotation)

    def placed(self, center, rotation: Rotation, world: Rotation | None = None, origin=(0.0, 0.0, 0.0)):
        """Both shapes where they stand, the second at some place of the world."""
        world = Rotation.identity() if world is None else world
        origin = np.broadcast_to(origin, np.shape(center))
        a = shape(*self.shapes[0], origin + world.apply(center), world * rotation)
        b = shape(*self.shapes[1], origin, Rotation.from_matrix(np.broadcast_to(world.as_matrix(), rotation.as_matrix().shape)))
        return a, b


def depth(P: np.ndarray, Q: np.ndarray) -> float:
    """How far a point can be inside two convex polyhedra at once, given as rows (n, d) of n · x ≤ d; negative if in none [m].

    The radius of the largest ball in both: a linear program.
    """
    rows = np.vstack([P, Q])
    A = np.column_stack([rows[:, :3], np.ones(len(rows))])
    result = linprog([0, 0, 0, -1], A_ub=A, b_ub=rows[:, 3], bounds=[(None, None)] * 4)
    return float(-result.fun)


def apart(P: np.ndarray, Q: np.ndarray) -> float:
    """Distance of the hulls of two sets of points [m]: a quadratic program."""
    m, n = len(P), len(Q)
    M = np.vstack([P, -Q])

    def square(w):
        d = w @ M
        return d @ d, 2.0 * M @ d

    ones = [np.r_[np.ones(m), np.zeros(n)], np.r_[np.zeros(m), np.ones(n)]]
    constraints = [{"type": "eq", "fun": lambda w, a=a: a @ w - 1.0, "jac": lambda w, a=a: a} for a in ones]
    start = np.r_[np.full(m, 1.0 / m), np.full(n, 1.0 / n)]
    result = minimize(
        square,
        start,
        jac=True,
        bounds=[(0.0, 1.0)] * (m + n),
        constraints=constraints,
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    return float(np.sqrt(result.fun))


def halfspaces(solid: Polyhedron, center, R) -> np.ndarray:
    """Of a polyhedron that stands there."""
    n = np.array([face[0] for face in solid.faces]) @ np.asarray(R).T
    return np.column_stack([n, np.array([face[1] for face in solid.faces]) + n @ np.asarray(center)])


def corners(solid: Polyhedron, center, R) -> np.ndarray:
    return np.asarray(center) + np.array(solid.vertices) @ np.asarray(R).T
