"""Wind on triangles of cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles.check import elements, in_range, per_element, settle
from articulated.particles.fields import Wind, field_of
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.scalar import Scalar, sqrt, where
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class TriangleWind(Law):
    """f = c A ((w − v) · n) n on a triangle of area A and normal n, a third of it on each corner; v is their mean velocity.

    What blows along a triangle passes by. It makes no difference which way round the corners are told. One without an area
    feels nothing.

    Attributes:
        triangles: numbers of particles, shape (m, 3).
        coefficient: c, a number or one for each triangle, shape (m,) [N s/m³].
        wind: w [m/s]: a vector, or a function of time and place over scalars, taken in the middle; None is still air.
    """

    triangles: Any
    coefficient: Any
    wind: Wind | None = None

    def __post_init__(self) -> None:
        triangles = elements("TriangleWind: triangles", self.triangles, 3)
        coefficient = per_element("TriangleWind: coefficient", self.coefficient, len(triangles), "triangle")
        settle(self, triangles=triangles, coefficient=coefficient, wind=field_of(self.wind, "TriangleWind: wind"))

    def bound(self, x: np.ndarray, mass: np.ndarray) -> TriangleWind:
        in_range("TriangleWind: triangles", self.triangles, len(x))
        return self

    @property
    def particles(self) -> np.ndarray:
        return self.triangles

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        return (self.coefficient,)

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        (a, b, c), (coefficient,) = points, constants
        third = 1.0 / 3.0
        flow = self.wind(t, (a.x + b.x + c.x) * third) - (a.v + b.v + c.v) * third  # type: ignore[operator, misc]
        n, area = _normal(points)
        return [n * (third * coefficient * area * flow.dot(n))] * 3

    def convex_resistance(
        self, t: Scalar, points: Sequence[Point], moves: Sequence[Vec3], h: Scalar, *constants: Scalar
    ) -> Sequence[Vec3]:
        """That of the drag; how it changes with the shape is left out."""
        (p, q, r), (coefficient,) = moves, constants
        n, area = _normal(points)
        return [n * ((1.0 / 9.0) * h * coefficient * area * (p + q + r).dot(n))] * 3


def _normal(points: Sequence[Point]) -> tuple[Vec3, Scalar]:
    """A triangle's unit normal and area."""
    a, b, c = points
    twice = (b.x - a.x).cross(c.x - a.x)
    square = twice.dot(twice)
    is_there = square > 0.0
    length = sqrt(where(is_there, square, 1.0))
    return twice * where(is_there, 1.0 / length, 0.0), where(is_there, 0.5 * length, 0.0)
