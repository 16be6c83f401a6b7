"""Strands in machine code: implicit steps of many chains of particles, from tip to root and back, side by side.

The linear step is the first turn of `solvers.implicit`, from the velocities that there are: A δ = b, with A = M + h D + h² K
and b = h f, both where particles would go with these (Baraff and Witkin, Large Steps in Cloth Simulation, 1998, equation 16).
Later turns have M (v₀ − v) in b besides. It is solved as in `chains`, where the symbols are told, while it is gathered: nothing
but D⁻¹ E, D⁻¹ F and D⁻¹ r of each particle is kept on the way in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.compiler.interpreter import interpreting
from articulated.compiler.scans import Chained, Scan, ScanKernel
from articulated.particles.chains import Chains, Factor
from articulated.particles.collisions import collided
from articulated.particles.forces.force import Law
from articulated.particles.layers import layers
from articulated.particles.points import Point
from articulated.particles.resident import Laid
from articulated.scalar import Scalar, either, where
from articulated.spatial import Mat3, Sym3, Vec3

Scalars = Sequence[Scalar]


@dataclass(eq=False)
class _Rows:
    """The equations of a particle and of those before it, as far as they are known: D, E and F, and r.

    Attributes:
        D: of each with itself.
        E: of one with another before it.
        r: right sides.
    """

    D: list[Sym3]
    E: dict[tuple[int, int], Mat3]
    r: list[Vec3]

    @staticmethod
    def size(reach: int) -> int:
        """Numbers that are handed on."""
        return 9 if reach == 1 else 27

    @staticmethod
    def of(handed: Scalars, reach: int) -> _Rows:
        """As the particle after it hands them on; nothing is known of the farthest yet."""
        D = [Sym3(*handed[9 * k : 9 * k + 6]) for k in range(reach)]
        r = [Vec3.of(handed[9 * k + 6 : 9 * k + 9]) for k in range(reach)]
        E = {(a, b): Mat3.zero() for b in range(reach + 1) for a in range(b)}
        if reach == 2:
            E[0, 1] = Mat3.of([handed[k : k + 3] for k in (18, 21, 24)])
        return _Rows([*D, Sym3.zero()], E, [*r, Vec3.zero()])

    def handed(self) -> list[Scalar]:
        """What goes to the particle before."""
        some = [x for D, r in zip(self.D[1:], self.r[1:], strict=True) for x in (*D, *r)]
        return [*some, *(x for row in self.E[1, 2].rows for x in row)] if (1, 2) in self.E else some


class Strands:
    """The strands of a system as a scan.

    Attributes:
        scan: the work.
        fixed: what it knows of each particle, shape (count, length, fixed).
    """

    def __init__(self, system: Any, kind: str):
        """Of a system with chains.

        Args:
            system: the system.
            kind: "step"; "rooted", a step of what has its first particles moved by others; or "turn", one of Newton's method,
                for which velocities before the step are carried besides, and which leaves their change.
        """
        chains: Chains = system.chains
        rooted, self._turns = kind == "rooted", kind == "turn"
        carried = self._carried = 9 if self._turns else 6
        self._count, self._length, self._forces = chains.count, chains.length, system.forces
        self._colliders = () if rooted else system.colliders
        held = system.inverse_mass.reshape(chains.count, chains.length) == 0.0
        self._pins, self._firsts_only = system.pins, not held[:, 1:].any()
        self._layers = layers(chains, system.forces)
        self._reach = max(layer.reach for layer in self._layers)
        self._alone = [law for law in system.forces if isinstance(law, Law) and law.particles is None]
        shape = chains.count, chains.length
        planes = [system.mass.reshape(shape), system.inverse_mass.reshape(shape)]
        planes += [c.reshape(shape) for law in self._alone for c in law.constants if c.ndim]
        planes += [plane for layer in self._layers for plane in layer.fixed()]
        self.fixed = np.stack(planes, axis=2)
        self.scan = Scan(
            name="strands",
            length=chains.length,
            reach=self._reach,
            carried=carried,
            fixed=len(planes),
            numbers=2,
            handed=_Rows.size(self._reach),
            kept=3 + 9 * self._reach,
            passed=3 * self._reach,
            inward=self._inward,
            outward=self._outward,
            go_on=lambda numbers: [numbers[0] + numbers[1], numbers[1]],
            root=self._root if rooted else None,
            results=9 if rooted else 0,
        )

    def _inward(self, rows: Sequence[Scalars], handed: Scalars, numbers: Scalars) -> tuple[Scalars, Scalars]:
        """Gather all that ends at a particle, and give it up."""
        here = self._gathered(rows, handed, numbers)
        if self._pins and not (self._firsts_only and len(rows) > 1):
            factor = Factor.where_free(here.D[0], where(rows[0][self._carried + 1] > 0.0, 1.0, 0.0))
        else:
            factor = Factor.of(here.D[0])
        y, parts = factor.solve(here.r[0]), {}
        for k in range(1, len(rows)):
            parts[k] = factor.solve_each(here.E[0, k])
            here.r[k] = here.r[k] - here.E[0, k].transpose_times(y)
            for n in range(1, k + 1):
                if n == k:
                    here.D[k] = here.D[k] - Sym3.upper_of_product(here.E[0, k].T, parts[k].T)
                else:
                    here.E[n, k] = here.E[n, k] - here.E[0, n].T @ parts[k]
        kept = [*y]
        for k in range(1, self._reach + 1):
            kept += [x for row in parts.get(k, Mat3.zero()).rows for x in row]
        return here.handed(), kept

    def _gathered(self, rows: Sequence[Scalars], handed: Scalars, numbers: Scalars) -> _Rows:
        """All that acts on a particle, of which those after it are given up; and of what ends at it on those before."""
        t, h = numbers[0] + numbers[1], numbers[1]
        here = _Rows.of(handed, self._reach)
        own = self._carried
        points = [Point(Vec3.of(row[:3]) + Vec3.of(row[3:6]) * h, Vec3.of(row[3:6]), row[own]) for row in rows]
        here.D[0] = here.D[0] + Sym3.scaled_identity(points[0].m)
        if self._turns:
            here.r[0] = here.r[0] + (Vec3.of(rows[0][6:9]) - points[0].v) * points[0].m
        given = iter(rows[0][own + 2 :])
        for law in self._alone:
            self._act(here, law, (0,), points, law.constants_of(given), None, t, h)
        for layer in self._layers:
            there = None if layer.everywhere else next(given)
            constants = [next(given) if c.ndim else float(c) for c in layer.constants]
            if layer.reach < len(rows):
                self._act(here, layer.law, layer.behind, points, constants, there, t, h)
        return here

    def _act(
        self,
        here: _Rows,
        law: Law,
        behind: tuple[int, ...],
        points: Sequence[Point],
        constants: Scalars,
        there: Scalar | None,
        t: Scalar,
        h: Scalar,
    ) -> None:
        """Add what an element does; `there` tells whether there is one, None that there always is."""
        some, size = [points[k] for k in behind], len(behind)

        def counted(f: Vec3) -> Vec3:
            return f if there is None else either(there > 0.5, f, Vec3.zero())

        for k, f in zip(behind, law.pull(t, some, *constants), strict=True):
            here.r[k] = here.r[k] + counted(f * h)
        for b, column in enumerate(behind):
            columns = [[Vec3.zero()] * size for _ in range(3)]
            for c, unit in enumerate((Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))):
                moves = [unit if n == b else Vec3.zero() for n in range(size)]
                columns[c] = [counted(f) for f in law.convex_resistance(t, some, moves, h, *constants)]
            for a, row in enumerate(behind):
                block = Mat3(*(columns[c][a] for c in range(3))).T
                if row == column:
                    here.D[row] = here.D[row] + Sym3.upper(block)
                elif row < column:
                    here.E[row, column] = here.E[row, column] + block

    def _outward(self, row: Scalars, kept: Scalars, passed: Scalars, numbers: Scalars) -> tuple[Scalars, Scalars]:
        """The new velocity and place of a particle, once those of the ones before it are known."""
        (t, h), x, v = numbers, Vec3.of(row[:3]), Vec3.of(row[3:6])
        change = Vec3.of(kept[:3])
        for k in range(self._reach):
            part = Mat3.of([kept[n : n + 3] for n in range(3 + 9 * k, 12 + 9 * k, 3)])
            change = change - part @ Vec3.of(passed[3 * k : 3 * k + 3])
        passes = [*change, *passed[: 3 * (self._reach - 1)]]
        if self._turns:
            return [*row[:3], *change, *row[6:9]], passes
        new_v = v + change
        new = x + new_v * h, new_v
        if self._colliders:
            new = collided(self._colliders, t, h, x, v, *new, row[7] > 0.0 if self._pins else True)
        return [*new[0], *new[1]], passes

    def _root(self, row: Scalars, handed: Scalars, numbers: Scalars) -> Scalars:
        """D and r of a root: what it takes to move it, and what pulls at it."""
        here = self._gathered([row], handed, numbers)
        return [*here.D[0], *here.r[0]]


def are_strands(system: Any) -> bool:
    """Whether machine code can take a system's linear implicit steps."""
    laws = all(isinstance(force, Law) for force in system.forces)
    return not interpreting() and system.chains is not None and laws


def laid_out(system: Any) -> SideBySide:
    """Room for a system of chains, and for what takes its linear implicit steps."""
    return SideBySide(system, bound_to(system, "step"))


def turn(system: Any, h: float, v: np.ndarray) -> np.ndarray:
    """The change of velocities v in a turn of Newton's method."""
    bound = bound_to(system, "turn")
    if bound.work is None:
        bound.work = SideBySide(system, bound, system.v)
    work = bound.work
    work.chained.put(bound.nodes(system.x, v, system.v))
    work.numbers[:] = system.time, h
    work.take(1, None)
    return work.state()[1]


class SideBySide(Laid):
    """A state as chains side by side."""

    def __init__(self, system: Any, bound: Bound, *others: np.ndarray):
        """Of a system, and of what particles carry besides places and velocities."""
        self._bound, self.chained = bound, bound.chained(system.x, system.v, *others)
        self.numbers = np.zeros(2, system.dtype)
        self._go = bound.kernel.bound(self.chained, self.numbers)

    def put(self, system: Any) -> None:
        self.chained.put(self._bound.nodes(system.x, system.v))

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        return self._bound.state(self.chained)

    def take(self, steps: int, threads: int | None) -> tuple[float, int]:
        return 0.0, self._go(steps, threads)


@dataclass(eq=False)
class Bound:
    """Strands of a system in machine code, and what is fixed of them, laid out.

    Attributes:
        work: of turns of Newton's method, where it works.
    """

    strands: Strands
    kernel: ScanKernel
    fixed: np.ndarray
    work: SideBySide | None = None

    def chained(self, *carried: np.ndarray) -> Chained:
        """What particles carry, each of shape (n, 3), laid out."""
        return Chained.of(self.strands.scan, self.nodes(*carried), self.fixed)

    def nodes(self, *carried: np.ndarray) -> np.ndarray:
        """Chain by chain."""
        return np.concatenate(carried, axis=1).reshape(*self.strands.fixed.shape[:2], -1)

    def state(self, chained: Chained) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of chains."""
        rows = chained.nodes(len(self.strands.fixed)).reshape(-1, self.strands.scan.carried)
        return rows[:, :3].copy(), rows[:, 3:6].copy()


def bound_to(system: Any, kind: str) -> Bound:
    """Made once for what a system's lists are; see `Strands`."""
    known, key = kernels_of(system.like), ("strands", kind, system.single, system.forces, system.colliders)
    if key not in known:
        strands = Strands(system, kind)
        kernel = ScanKernel(strands.scan, system.single)
        known[key] = Bound(strands, kernel, kernel.laid_out(strands.fixed))
    return known[key]
