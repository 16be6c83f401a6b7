"""Particles that do not act on each other: each goes its own way, many side by side, all steps at once in registers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.compiler.interpreter import interpreting
from articulated.compiler.streams import Stream, planes, stream_kernel
from articulated.particles.colliders import Collider
from articulated.particles.collisions import collided
from articulated.particles.forces.force import Force, Law
from articulated.particles.points import Point
from articulated.particles.solvers.explicit import EXPLICIT, LAGS
from articulated.scalar import Scalar
from articulated.spatial import Vec3


def are_alone(forces: Sequence[Force], colliders: Sequence[Collider] = ()) -> bool:
    """Whether machine code can take each particle for itself."""
    laws = all(isinstance(force, Law) and force.particles is None for force in forces)
    return not interpreting() and laws and all(collider.compiles for collider in colliders)


@dataclass(frozen=True, eq=False)
class Planes:
    """A state as planes: positions, velocities, mass and its inverse, constants."""

    key: Any
    memory: np.ndarray
    count: int

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities."""
        return self.memory[:3, : self.count].T.copy(), self.memory[3:6, : self.count].T.copy()


def advance(system: Any, h: float, steps: int, solver: str, threads: int | None) -> int:
    """Take a system so many steps on; flags of its kernel."""
    of_each = [c for force in system.forces for c in force.constants if c.ndim]
    known, key = kernels_of(system.like), ("alone", solver, system.single, system.forces, system.colliders)
    if (kernel := known.get(key)) is None:
        kernel = known[key] = stream_kernel(_stream(system, solver, len(of_each)), system.single)
    if (laid := system.laid("alone")) is None:
        memory = planes([*system.x.T, *system.v.T, system.mass, system.inverse_mass, *of_each], system.dtype)
        laid = Planes("alone", memory, len(system.mass))
    numbers = np.array([system.time, h], system.dtype)
    arrays = [(plane, plane.itemsize, 0, None) for plane in (*laid.memory, numbers)]
    flags = kernel(arrays, laid.memory.shape[1], threads, [steps], steps)
    system.lay(laid, float(system.time + steps * h))
    return flags


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
            new = collided(system.colliders, t, h, x, v, *new, inverse > 0.0, LAGS[solver])
        return [*new[0], *new[1], t + h, h]

    return Stream("particles", 6, 2 + given, 2, turn)
