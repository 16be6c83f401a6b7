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
from articulated.particles.resident import Laid
from articulated.particles.together import Rows, elements_of, filled, of_nodes
from articulated.scalar import Scalar, where
from articulated.spatial import Mat3, Sym3, Vec3

Scalars = Sequence[Scalar]
_UNITS = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)


def are_woven(system: Any) -> bool:
    """Whether machine code can take a system's linear implicit steps by conjugate gradients."""
    laws = all(isinstance(force, Law) for force in system.forces)
    return not interpreting() and laws and all(collider.compiles for collider in system.colliders)


def laid_out(system: Any, iterations: int) -> Woven:
    """Room for a system, and for what takes its linear steps, so many turns of conjugate gradients in each."""
    return Woven(system, _bound_to(system, linear=True), iterations)


def turn(system: Any, h: float, v: np.ndarray, iterations: int) -> tuple[np.ndarray, float]:
    """The change of velocities v in a turn of Newton's method, and what is left of its equation [m/s]."""
    bound = _bound_to(system, linear=False)
    work = bound.work = Woven(system, bound, iterations) if bound.work is None else bound.work
    work.put(system, v)
    for plane, before in zip(bound.constants[-3:], system.v.T, strict=True):
        plane[: len(before)] = before
    work.numbers[:] = system.time, h
    left, _ = work.take(1, None, iterations)
    return work.state()[1], left


class Woven(Laid):
    """A state as rows, with room for what conjugate gradients carry."""

    def __init__(self, system: Any, bound: Bound, iterations: int):
        self.rows, self.numbers = Rows.of(system, bound.kernel.format, 8), np.zeros(2, system.dtype)
        n = len(self.rows.rows)
        shapes = (bound.kernel.planes, n), (n, SUM), (n, SUM), (n, 2 * SUM)
        room = tuple(on_a_line(shape, system.dtype) for shape in shapes)
        self._mass, self._iterations = 1.0, iterations
        self._go = bound.kernel.bound(self.rows.rows, room, bound.constants, bound.elements, self.numbers)  # type: ignore[arg-type]

    def put(self, system: Any, v: np.ndarray | None = None) -> None:
        self.rows.put(system, system.x, system.v if v is None else v)
        self._mass = max(float(system.mass.sum()), np.finfo(float).tiny)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        return self.rows.state()

    def take(self, steps: int, threads: int | None, iterations: int | None = None) -> tuple[float, int]:
        left, flags = self._go(steps, iterations or self._iterations)
        return float(np.sqrt(max(left, 0.0) / self._mass)), flags


@dataclass(eq=False)
class Bound:
    """A system's laws in machine code, with what belongs to nodes and elements.

    Attributes:
        work: of turns of Newton's method, where it works.
    """

    kernel: ImplicitKernel
    constants: list[np.ndarray]
    elements: list[tuple[np.ndarray, list[np.ndarray], np.ndarray]]
    work: Woven | None = None

    @staticmethod
    def of(system: Any, linear: bool) -> Bound:
        """For linear steps, or for turns of Newton's method; nodes have the velocity before the step then."""
        kernel, elements = ImplicitKernel(_implicit(system, linear), system.single), []
        lanes, dtype = kernel.format.lanes, kernel.format.dtype
        for (nodes, given), kept in zip(elements_of(system, lanes, dtype, 8), kernel.kept, strict=True):
            elements.append((nodes, given, on_a_line((len(nodes), kept, lanes), dtype)))
        of_each = [*of_nodes(system), *([] if linear else system.v.T)]
        return Bound(kernel, [filled(c, 8, dtype) for c in of_each], elements)


def _bound_to(system: Any, linear: bool) -> Bound:
    """Made once for what a system's lists are."""
    known, key = kernels_of(system.like), ("woven", linear, system.single, system.forces, system.colliders)
    if (bound := known.get(key)) is None:
        bound = known[key] = Bound.of(system, linear)
    return bound


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
            new = collided(system.colliders, t, h, x, v, *new, row[7] > 0.0 if system.pins else True)
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
