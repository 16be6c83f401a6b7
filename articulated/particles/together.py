"""Particles that act on each other: machine code goes through all elements and all particles, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.compiler.interpreter import interpreting
from articulated.compiler.ir import Format
from articulated.compiler.meshes import Elements, Mesh, MeshKernel
from articulated.compiler.rows import ROW, SUM
from articulated.compiler.streams import on_a_line
from articulated.particles.colliders import Collider
from articulated.particles.collisions import collided
from articulated.particles.forces.force import Force, Law
from articulated.particles.points import Point
from articulated.particles.resident import Laid
from articulated.particles.solvers.explicit import EXPLICIT, LAGS
from articulated.scalar import Scalar
from articulated.spatial import Vec3

ONE_STAGE = ("euler", "semi_implicit")
"""Methods that ask once in a step what acts."""

_STRIDE = 16
"""How many elements on the next one is that is done."""

Scalars = Sequence[Scalar]
Told = Callable[[Law, Scalar, Sequence[Point], Scalars], Sequence[Vec3]]
"""Of an element of a law, at a time and with its constants: three numbers of each of its particles."""


def are_laws(forces: Sequence[Force], solver: str, colliders: Sequence[Collider] = ()) -> bool:
    """Whether machine code can take all of them, and the method."""
    known = all(isinstance(force, Law) for force in forces) and all(collider.compiles for collider in colliders)
    return not interpreting() and solver in ONE_STAGE and known


@dataclass(frozen=True, eq=False)
class Rows:
    """A state as rows of eight: position, mass, velocity, inverse mass; and room for sums."""

    rows: np.ndarray
    sums: np.ndarray
    count: int

    @staticmethod
    def of(system: Any, f: Format, group: int = 0) -> Rows:
        """Room for a system, a whole number of registers or of groups."""
        size = _size(len(system.mass), max(f.lanes, group))
        return Rows(on_a_line((size, ROW), f.dtype), on_a_line((size, SUM), f.dtype), len(system.mass))

    def put(self, system: Any, x: np.ndarray, v: np.ndarray) -> None:
        """Have it in a state."""
        n, rows = self.count, self.rows
        rows[:n, :3], rows[:n, 3], rows[:n, 4:7], rows[:n, 7] = x, system.mass, v, system.inverse_mass
        rows[n:] = 0.0
        rows[n:, 0] = np.arange(len(rows) - n)  # what fills up elements is on nodes of its own, which are not in one place

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities."""
        return self.rows[: self.count, :3].copy(), self.rows[: self.count, 4:7].copy()


class Meshed(Laid):
    """A state as rows, with what goes through all of it."""

    def __init__(self, system: Any, bound: Bound):
        self.rows, self.numbers = Rows.of(system, bound.kernel.format), np.zeros(2, system.dtype)
        self._go = bound.go(self.rows, self.numbers)

    def put(self, system: Any) -> None:
        self.rows.put(system, system.x, system.v)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        return self.rows.state()

    def take(self, steps: int, threads: int | None) -> tuple[float, int]:
        return 0.0, self._go(steps)


@dataclass(frozen=True, eq=False)
class Bound:
    """A mesh's kernel, with what belongs to the nodes and elements of a system."""

    kernel: MeshKernel
    elements: list[tuple[np.ndarray, list[np.ndarray]]]
    constants: list[np.ndarray]

    @staticmethod
    def of(system: Any, mesh: Mesh, single: bool) -> Bound:
        """Of a mesh that is made of a system."""
        kernel = MeshKernel(mesh, single)
        lanes, dtype = kernel.format.lanes, kernel.format.dtype
        return Bound(kernel, elements_of(system, lanes, dtype), [filled(c, lanes, dtype) for c in of_nodes(system)])

    def go(self, rows: Rows, numbers: np.ndarray) -> Callable[[int], int]:
        """What takes so many steps of rows."""
        return self.kernel.bound(rows.rows, rows.sums, self.constants, self.elements, numbers)


def laid_out(system: Any, solver: str) -> Meshed:
    """Room for a system, and for what takes its steps."""
    known, key = kernels_of(system.like), ("together", solver, system.single, system.forces, system.colliders)
    if (bound := known.get(key)) is None:
        bound = known[key] = Bound.of(system, _mesh(system, solver), system.single)
    return Meshed(system, bound)


def _mesh(system: Any, solver: str) -> Mesh:
    """A step of all of them."""

    def end(row: Scalars, done: Scalars, constants: Scalars, numbers: Scalars) -> Scalars:
        point, (t, h), inverse = _point(row), numbers, row[7]
        a = Vec3.of(done) * inverse
        x, v = EXPLICIT[solver](lambda *_: a, t, h, point.x, point.v)
        if system.colliders:
            free = inverse > 0.0 if system.pins else True
            x, v = collided(system.colliders, t, h, point.x, point.v, x, v, free, LAGS[solver])
        return [*x, row[3], *v, inverse]

    count, begin, laws = gone_through(system.forces)
    return Mesh("particles", count, 2, begin, laws, end, lambda numbers: [numbers[0] + numbers[1], numbers[1]])


def pull(law: Law, t: Scalar, points: Sequence[Point], constants: Scalars) -> Sequence[Vec3]:
    """The force on each particle of an element."""
    return law.pull(t, points, *constants)


def gone_through(forces: Sequence[Law], told: Told = pull) -> tuple[int, Callable[..., Scalars], list[Elements]]:
    """All forces as a mesh goes through them, at the time that its first number is.

    Args:
        forces: laws.
        told: what is added up of each element.

    Returns:
        How many numbers each particle has besides its row; how its sums begin; and what is between particles.
    """
    alone = [force for force in forces if force.particles is None]
    between = [force for force in forces if force.particles is not None]

    def begin(row: Scalars, constants: Scalars, numbers: Scalars) -> Scalars:
        total, given = Vec3.zero(), iter(constants)
        for force in alone:
            (own,) = told(force, numbers[0], [_point(row)], force.constants_of(given))
            total = total + own
        return [*total]

    def act(force: Law) -> Callable[[Sequence[Scalars], Scalars, Scalars], Sequence[Scalars]]:
        def some(rows: Sequence[Scalars], constants: Scalars, numbers: Scalars) -> Sequence[Scalars]:
            own = force.constants_of(iter(constants))
            return [[*f] for f in told(force, numbers[0], [_point(row) for row in rows], own)]

        return some

    laws = [Elements(force.particles.shape[1], sum(c.ndim for c in force.constants), act(force)) for force in between]  # type: ignore[union-attr]
    return sum(c.ndim for force in alone for c in force.constants), begin, laws


def elements_of(system: Any, lanes: int, dtype: Any, group: int = 0) -> list[tuple[np.ndarray, list[np.ndarray]]]:
    """Of each law between particles, whose they are and what it knows of each; a multiple of so many elements."""
    group, n, found = max(group, lanes), len(system.mass), []
    for force in system.forces:
        if force.particles is None:
            continue
        count, size = force.particles.shape
        numbers = np.empty((-(-count // group) * group, size), np.int32)
        order = np.argsort(force.particles.min(axis=1), kind="stable")[_apart(count)]  # what is near is near in memory too
        numbers[:count], numbers[count:] = force.particles[order], n + np.arange(size)
        numbers *= SUM * np.dtype(dtype).itemsize
        blocks = np.ascontiguousarray(numbers.reshape(-1, lanes, size).transpose(0, 2, 1))
        found.append((blocks, [filled(c[order], group, dtype) for c in force.constants if c.ndim]))
    return found


def _apart(count: int) -> np.ndarray:
    """So many elements in an order in which neighbours, which often have a particle in common, are not done one after another.

    Sums would wait for each other. It is the same for all registers, and so are sums.
    """
    order, window = [], 8 * _STRIDE
    for first in range(0, count, window):
        some = min(window, count - first)
        stride = -(-some // 8)
        turned = np.arange(8 * stride).reshape(8, stride).T.ravel()
        order.append(first + turned[turned < some])
    return np.concatenate(order) if order else np.zeros(0, dtype=np.int64)


def of_nodes(system: Any) -> list[np.ndarray]:
    """What belongs to each particle, besides its row."""
    return [c for force in system.forces if force.particles is None for c in force.constants if c.ndim]


def filled(constants: np.ndarray, lanes: int, dtype: Any) -> np.ndarray:
    """One for each of a whole number of registers."""
    result = on_a_line((_size(len(constants), lanes),), dtype)
    result[: len(constants)], result[len(constants) :] = constants, constants[-1] if len(constants) else 0.0
    return result


def _size(count: int, lanes: int) -> int:
    """Room for so many, and for what fills up elements."""
    return -(-(count + ROW) // lanes) * lanes


def _point(row: Scalars) -> Point:
    return Point(Vec3.of(row[:3]), Vec3.of(row[4:7]), row[3])
