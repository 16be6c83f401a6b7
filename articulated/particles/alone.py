"""Particles that do not act on each other: each goes its own way, many side by side, all steps at once in registers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.compiler.interpreter import interpreting
from articulated.compiler.kernels import Kernel
from articulated.compiler.streams import Stream, planes, stream_kernel
from articulated.particles.colliders import Collider
from articulated.particles.collisions import collided
from articulated.particles.forces.force import Force, Law
from articulated.particles.points import Point
from articulated.particles.resident import Laid
from articulated.particles.solvers.explicit import EXPLICIT, LAGS
from articulated.scalar import Scalar
from articulated.spatial import Vec3


def are_alone(forces: Sequence[Force], colliders: Sequence[Collider] = ()) -> bool:
    """Whether machine code can take each particle for itself."""
    laws = all(isinstance(force, Law) and force.particles is None for force in forces)
    return not interpreting() and laws and all(collider.compiles for collider in colliders)


_PART = 1 << 14
"""Particles that are laid out at once: their rows stay in a cache while they are turned."""


class Planes(Laid):
    """A state as planes: positions, velocities, mass and its inverse, constants."""

    def __init__(self, system: Any, kernel: Kernel):
        of_each = _of_each(system)
        self._count = len(system.mass)
        rows = [*np.zeros((6, self._count)), system.mass, system.inverse_mass, *of_each]
        self._memory, self.numbers = planes(rows, system.dtype), np.zeros(2, system.dtype)
        self._go = kernel.bound([*self._memory, self.numbers], 1)

    def put(self, system: Any) -> None:
        n, x, v = self._count, system.x, system.v
        for first in range(0, n, _PART):
            some = slice(first, min(first + _PART, n))
            self._memory[:3, some], self._memory[3:6, some] = x[some].T, v[some].T
        self._memory[:6, n:] = self._memory[:6, n - 1 : n] if n else 0.0  # what fills up registers does what the last one does

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        return self._memory[:3, : self._count].T.copy(), self._memory[3:6, : self._count].T.copy()

    def take(self, steps: int, threads: int | None) -> tuple[float, int]:
        return 0.0, self._go(self._memory.shape[1], threads, [steps], steps)


def laid_out(system: Any, solver: str) -> Planes:
    """Room for a system whose particles are alone, and for what takes its steps."""
    known, key = kernels_of(system.like), ("alone", solver, system.single, system.forces, system.colliders)
    if (kernel := known.get(key)) is None:
        kernel = known[key] = stream_kernel(_stream(system, solver, len(_of_each(system))), system.single)
    return Planes(system, kernel)


def _of_each(system: Any) -> list[np.ndarray]:
    return [c for force in system.forces for c in force.constants if c.ndim]


def _stream(system: Any, solver: str, given: int) -> Stream:
    """A step of each particle."""

    def turn(carried: Sequence[Scalar], fixed: Sequence[Scalar], numbers: Sequence[Scalar]) -> list[Scalar]:
        (mass, inverse), of_each, (t, h) = fixed[:2], iter(fixed[2:]), numbers
        constants = [force.constants_of(of_each) for force in system.forces]

        def acceleration(t: Scalar, x: Vec3, v: Vec3) -> Vec3:
            total = Vec3.zero()
            for force, values in zip(system.forces, constants, strict=True):
                (f,) = force.pull(t, [Point(x, v, mass)], *values)
                total = total + f
            return total * inverse

        x, v = Vec3.of(carried[:3]), Vec3.of(carried[3:])
        new = EXPLICIT[solver](acceleration, t, h, x, v)
        if system.colliders:
            new = collided(system.colliders, t, h, x, v, *new, inverse > 0.0 if system.pins else True, LAGS[solver])
        return [*new[0], *new[1], t + h, h]

    return Stream("particles", 6, 2 + given, 2, turn)
