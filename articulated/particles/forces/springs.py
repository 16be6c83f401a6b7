"""Damped springs between particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from articulated.particles.check import elements, in_range, per_element, settle
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.scalar import Scalar, maximum, sqrt, where
from articulated.spatial import Vec3

_LEAST = 1e-30
"""Square of a length that is none [m²]."""


@dataclass(frozen=True, eq=False)
class Springs(Law):
    """f = −[k_s (|Δx| − r) + k_d Δv·Δx/|Δx|] Δx/|Δx| on the first of two particles, and the opposite on the second.

    One whose ends are in one place has no direction, and pushes nowhere.

    Attributes:
        pairs: numbers of particles, shape (m, 2).
        stiffness: k_s, a number or one for each spring, shape (m,) [N/m].
        damping: k_d [N s/m].
        rest_length: r [m]; None is the length that each has where the particles start.
    """

    pairs: Any
    stiffness: Any
    damping: Any = 0.0
    rest_length: Any = None

    def __post_init__(self) -> None:
        pairs = elements("Springs: pairs", self.pairs, 2)
        settle(
            self,
            pairs=pairs,
            stiffness=per_element("Springs: stiffness", self.stiffness, len(pairs), "spring"),
            damping=per_element("Springs: damping", self.damping, len(pairs), "spring"),
        )
        if self.rest_length is not None:
            settle(self, rest_length=per_element("Springs: rest_length", self.rest_length, len(pairs), "spring"))

    def bound(self, x: np.ndarray, mass: np.ndarray) -> Springs:
        in_range("Springs: pairs", self.pairs, len(x))
        if self.rest_length is not None:
            return self
        length = np.linalg.norm(x[self.pairs[:, 0]] - x[self.pairs[:, 1]], axis=1)
        if not length.all():
            where = int(np.argmin(length))
            raise ValueError(
                f"Springs: pairs[{where}] joins particles {self.pairs[where].tolist()}, which start in one place; "
                "move one of them, or give a rest_length"
            )
        return replace(self, rest_length=length)

    @property
    def particles(self) -> np.ndarray:
        return self.pairs

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        return self.stiffness, self.damping, self.rest_length

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        (a, b), (stiffness, damping, rest) = points, constants
        u, length, _ = _direction(a.x - b.x)
        f = u * (stiffness * (rest - length) - damping * (a.v - b.v).dot(u))
        return [f, -f]

    def potential(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Scalar:
        (a, b), (stiffness, _, rest) = points, constants
        _, length, _ = _direction(a.x - b.x)
        return 0.5 * stiffness * (length - rest) * (length - rest)

    def convex_resistance(
        self, t: Scalar, points: Sequence[Point], moves: Sequence[Vec3], h: Scalar, *constants: Scalar
    ) -> Sequence[Vec3]:
        """h D + h² K as a I + b u uᵀ between the two: a spring that is too short does not stiffen across itself.

        How the damping changes with the direction is left out.
        """
        (a, b), (stiffness, damping, rest), (p, q) = points, constants, moves
        u, _, inverse = _direction(a.x - b.x)
        along = h * h * stiffness
        across = along * maximum(1.0 - rest * inverse, 0.0)
        relative = p - q
        f = relative * across + u * ((along - across + h * damping) * u.dot(relative))
        return [f, -f]


def _direction(d: Vec3) -> tuple[Vec3, Scalar, Scalar]:
    """A vector's direction, its length, and the inverse of that; all zero if it is too short to have a direction."""
    square = d.dot(d)
    is_long = square > _LEAST
    length = sqrt(where(is_long, square, 1.0))
    inverse = where(is_long, 1.0 / length, 0.0)
    return d * inverse, where(is_long, length, 0.0), inverse
