"""What acts on all particles of a system, in any state, in machine code: for methods that ask more than once in a step.

A kernel goes once through all particles and elements, as in `together`, and tells what came of it instead of taking a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.compiler.interpreter import interpreting
from articulated.compiler.meshes import Mesh
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.particles.together import Bound, Rows, Told, gone_through, pull
from articulated.scalar import Scalar
from articulated.spatial import Vec3

Scalars = Sequence[Scalar]


def are_summed(system: Any) -> bool:
    """Whether machine code can tell what acts on a system."""
    return not interpreting() and len(system.mass) > 0 and all(isinstance(force, Law) for force in system.forces)


def acting(system: Any) -> Any:
    """Who tells what acts on a system: machine code if it can, else the system itself."""
    return Sums(system) if are_summed(system) else system


class Sums:
    """What acts on a system, told by machine code in float64; but for rounding what the system tells itself."""

    def __init__(self, system: Any):
        self._system = system

    def force(self, t: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """See `System.force`."""
        return self._told("forces", pull, t, x, v).copy()

    def energy(self, t: float, x: np.ndarray, v: np.ndarray) -> float:
        """See `System.energy`."""
        return 0.5 * float(self._system.mass @ (v * v).sum(axis=1)) + self._energies(t, x, v)[0]

    def power(self, t: float, x: np.ndarray, v: np.ndarray) -> float:
        """See `System.power`."""
        return self._energies(t, x, v)[1]

    def _energies(self, t: float, x: np.ndarray, v: np.ndarray) -> list[float]:
        return self._told("energies", _energy, t, x, v).sum(axis=0).tolist()

    def _told(self, name: str, told: Told, t: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Sums of all that is told of each particle, shape (n, 3), in memory that is used again."""
        system = self._system
        known, key = kernels_of(system.like), (name, system.forces)
        if (found := known.get(key)) is None:
            bound = Bound.of(system, _mesh(name, system.forces, told), single=False)
            rows, numbers = Rows.of(system, bound.kernel.format), np.zeros(1)
            found = known[key] = rows, numbers, bound.go(rows, numbers)
        rows, numbers, go = found
        rows.put(system, x, v)
        numbers[:] = t
        go(1)
        return rows.rows[: rows.count, :3]


def _mesh(name: str, forces: Sequence[Law], told: Told) -> Mesh:
    """One turn, which leaves sums where places were."""

    def end(row: Scalars, done: Scalars, constants: Scalars, numbers: Scalars) -> Scalars:
        return [*done, *row[3:]]

    count, begin, laws = gone_through(forces, told)
    return Mesh(name, count, 1, begin, laws, end, lambda numbers: numbers)


def _energy(law: Law, t: Scalar, points: Sequence[Point], constants: Scalars) -> Sequence[Vec3]:
    """Potential energy, and the power of what has none: with the first particle."""
    f = law.pull(t, points, *constants)
    if law.conservative:
        still = law.pull(t, [Point(p.x, Vec3.zero(), p.m) for p in points], *constants)
        f = [a - b for a, b in zip(f, still, strict=True)]
    power = sum((a.dot(p.v) for a, p in zip(f, points, strict=True)), 0.0)
    return [Vec3(law.potential(t, points, *constants), power, 0.0), *[Vec3.zero()] * (len(points) - 1)]
