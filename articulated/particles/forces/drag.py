"""Viscous drag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles.check import per_element, settle
from articulated.particles.fields import Wind, field_of
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.scalar import Scalar
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class Drag(Law):
    """f = −k (v − w), with the wind w.

    Attributes:
        coefficient: k, a number or one for each particle, shape (n,) [N s/m].
        wind: w [m/s]: a vector, or a function of time and place over scalars; None is still air.
    """

    coefficient: Any
    wind: Wind | None = None

    def __post_init__(self) -> None:
        settle(self, coefficient=per_element("Drag: coefficient", self.coefficient), wind=field_of(self.wind, "Drag: wind"))

    def bound(self, x: np.ndarray, mass: np.ndarray) -> Drag:
        per_element("Drag: coefficient", self.coefficient, len(x))
        return self

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        return (self.coefficient,)

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        (point,), (k,) = points, constants
        return [(self.wind(t, point.x) - point.v) * k]  # type: ignore[operator, misc]

    def convex_resistance(
        self, t: Scalar, points: Sequence[Point], moves: Sequence[Vec3], h: Scalar, *constants: Scalar
    ) -> Sequence[Vec3]:
        """That of the drag; how the wind changes from place to place is left out."""
        (p,), (k,) = moves, constants
        return [p * (k * h)]
