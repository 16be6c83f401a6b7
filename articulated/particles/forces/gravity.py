"""Weight, and other forces that fill space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles.check import settle, vector
from articulated.particles.fields import Field
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.scalar import Scalar
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class Gravity(Law):
    """The same acceleration for all particles.

    Attributes:
        acceleration: shape (3,) [m/s²].
    """

    acceleration: Any = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        settle(self, acceleration=vector("Gravity: acceleration", self.acceleration))

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        return tuple(np.asarray(g) for g in self.acceleration)

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        (point,) = points
        return [Vec3.of(constants) * point.m]

    def potential(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Scalar:
        (point,) = points
        return -(Vec3.of(constants).dot(point.x) * point.m)


@dataclass(frozen=True, eq=False)
class Acceleration(Law):
    """A field of accelerations: f = m a(t, x).

    Attributes:
        field: a, a function of time and place over scalars [m/s²]; see `fields`.
    """

    field: Field

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        (point,) = points
        return [self.field(t, point.x) * point.m]
