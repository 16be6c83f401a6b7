"""Implicit steps of particles that act on each other in any way, in machine code: cloth, and whatever is no chain.

The step is that of `strands`, A δ = b, here by conjugate gradients with a fixed number of turns, as `solvers.implicit` does it:
linear steps, one after the other, or a turn of Newton's method, whose b has M (v₀ − v) besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.compiler.conjugate_kernel import ImplicitKernel
from articulated.compiler.conjugates import Bonds, Implicit
from articulated.compiler.interpreter import interpreting
from articulated.compiler.rows import SUM
from articulated.compiler.streams import on_a_line
from articulated.particles.chains import Factor
from articulated.particles.collisions import collided
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.particles.together import Rows, elements_of, filled, of_nodes
from articulated.scalar import Scalar, where
from articulated.spatial import Mat3, Sym3, Vec3

Scalars = Sequence[Scalar]
_UNITS = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)


def are_woven(system: Any) -> bool:
    """Whether machine code can take a system's linear implicit steps by conjugate gradients."""
    laws = all(isinstance(force, Law) for force in system.forces)
    return not interpreting() and laws and all(collider.compiles for collider in system.colliders)


def advance(system: Any, h: float, steps: int, turns: int) -> tuple[float, int]:
    """Take a system so many linear implicit steps on: what is left [m/s], and flags of the kernel."""
    bound = bound_to(system, linear=True)
    laid = bound.laid(system) if (laid := system.laid("woven")) is None else laid
    left, flags = bound.solved(laid, system, h, steps, turns)
    system.lay(laid, float(system.time + steps * h))
    return left, flags


def turn(system: Any, h: float, v: np.ndarray, turns: int) -> tuple[np.ndarray, float]:
    """The change of velocities v in a turn of Newton's method, and what is left of its equation [m/s]."""
    bound = bound_to(system, linear=False)
    if bound.work is None:
        bound.work = bound.laid(system)
    bound.work.rows.put(system, system.x, v)
    for plane, before in zip(bound.constants[-3:], system.v.T, strict=True):
        plane[: len(before)] = before
    left, _ = bound.solved(bound.work, system, h, 1, turns)
    return bound.work.state()[1], left


def bound_to(system: Any, linear: bool) -> Bound:
    """Made once for what a system's lists are."""
    known, key = kernels_of(system.like), ("woven", linear, system.single, system.forces, system.colliders)
    if (bound := known.get(key)) is None:
        bound = known[key] = Bound.of(system, linear)
    return bound


@dataclass(frozen=True, eq=False)
class Laid:
    """A state as rows, with room for what conjugate gradients carry."""

    key: Any
    rows: Rows
    room: Any

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities."""
        return self.rows.state()


@dataclass(eq=False)
class Bound:
    """A system's laws in machine code, with what belongs to nodes and elements.

    Attributes:
        work: of turns of Newton's method, where it works.
    """

    kernel: ImplicitKernel
    constants: list[np.ndarray]
    elements: list[tuple[np.ndarray, list[np.ndarray], np.ndarray]]
    work: Laid | None = None

    @staticmethod
    def of(system: Any, linear: bool) -> Bound:
        """For linear steps, or for turns of Newton's method; nodes have the velocity before the step then."""
        kernel, elements = ImplicitKernel(_implicit(system, linear), system.single), []
        lanes = kernel.format.lanes
        for (nodes, given), kept in zip(elements_of(system, lanes, 8), kernel.kept, strict=True):
            elements.append((nodes, given, on_a_line((len(nodes), kept, lanes), system.dtype)))
        of_each = [*of_nodes(system), *([] if linear else system.v.T)]
        return Bound(kernel, [filled(c, 8, system.dtype) for c in of_each], elements)

    def laid(self, system: Any) -> Laid:
        """A system as it is."""
        rows = Rows.of(system, 8)
        n = len(rows.rows)
        shapes = (self.kernel.planes, n), (n, SUM), (n, SUM), (n, 2 * SUM)
        return Laid("woven", rows, tuple(on_a_line(shape, system.dtype) for shape in shapes))

    def solved(self, laid: Laid, system: Any, h: float, steps: int, turns: int) -> tuple[float, int]:
        """Take steps, with so many turns of conjugate gradients in each: what is left [m/s], and flags of the kernel."""
        given = np.array([system.time, h])
        left, flags = self.kernel(laid.rows.rows, laid.room, self.constants, self.elements, given, steps, turns)
        return float(np.sqrt(max(left, 0.0) / max(system.mass.sum(), np.finfo(float).tiny))), flags


def _implicit(system: Any, linear: bool) -> Implicit:
    """A step of all of them; or a turn, which leaves the change of velocities where these were."""
    alone = [force for force in system.forces if force.particles is None]
    between = [force for force in system.forces if force.particles is not None]

    def begin(row: Scalars, constants: Scalars, numbers: Scalars) -> tuple[Scalars, Scalars]:
        point, given = _ahead(row, numbers), iter(constants)
        b, D = Vec3.zero(), Sym3.scaled_identity(point.m)
        for force in alone:
            own = force.constants_of(given)
            b = b + force.pull(numbers[0] + numbers[1], [point], *own)[0] * numbers[1]
            D = D + _block(force, [point], 0, own, numbers)
        if not linear:
            b = b + (Vec3(*given) - point.v) * point.m
        return [*b], [*D]

    def bond(force: Law) -> Bonds:
        def act(rows: Sequence[Scalars], constants: Scalars, numbers: Scalars) -> tuple[list[Scalars], list[Scalars]]:
            points, own = [_ahead(row, numbers) for row in rows], force.constants_of(iter(constants))
            b = [f * numbers[1] for f in force.pull(numbers[0] + numbers[1], points, *own)]
            return [[*x] for x in b], [[*_block(force, points, k, own, numbers)] for k in range(len(points))]

        def product(rows: Sequence[Scalars], moves: Sequence[Scalars], constants: Scalars, numbers: Scalars) -> list[Scalars]:
            points, own = [_ahead(row, numbers) for row in rows], force.constants_of(iter(constants))
            p = [Vec3.of(move) for move in moves]
            return [[*f] for f in force.convex_resistance(numbers[0] + numbers[1], points, p, numbers[1], *own)]

        return Bonds(force.particles.shape[1], sum(c.ndim for c in force.constants), act, product)  # type: ignore[union-attr]

    def settle(row: Scalars, D: Scalars) -> Scalars:
        free = where(row[7] > 0.0, 1.0, 0.0)
        inverse = Factor.where_free(Sym3(*D), free)
        return [*Sym3.upper(Mat3(*(inverse.solve(unit) for unit in _UNITS)))]

    def end(row: Scalars, change: Scalars, constants: Scalars, numbers: Scalars) -> Scalars:
        if not linear:
            return [*row[:4], *change, row[7]]
        (t, h), x, v = numbers, Vec3.of(row[:3]), Vec3.of(row[4:7])
        new_v = v + Vec3.of(change)
        new = x + new_v * h, new_v
        if system.colliders:
            new = collided(system.colliders, t, h, x, v, *new, row[7] > 0.0)
        return [*new[0], row[3], *new[1], row[7]]

    count = sum(c.ndim for force in alone for c in force.constants) + (0 if linear else 3)
    bonds = [bond(force) for force in between]
    return Implicit("woven", count, 2, begin, bonds, settle, end, lambda numbers: [numbers[0] + numbers[1], numbers[1]])


def _block(force: Law, points: Sequence[Point], k: int, constants: Scalars, numbers: Scalars) -> Sym3:
    """Of the k-th point of an element, its block on the diagonal."""
    t, h, columns = numbers[0] + numbers[1], numbers[1], []
    for unit in _UNITS:
        moves = [unit if n == k else Vec3.zero() for n in range(len(points))]
        columns.append(force.convex_resistance(t, points, moves, h, *constants)[k])
    return Sym3.upper(Mat3(*columns).T)


def _ahead(row: Scalars, numbers: Scalars) -> Point:
    """A particle where it would go with the velocity that it has."""
    v = Vec3.of(row[4:7])
    return Point(Vec3.of(row[:3]) + v * numbers[1], v, row[3])
