"""The laws of one direction: what impulse answers a velocity at the end of the step. All are slopes of convex functions.

symbol   meaning                                                    unit
u        velocity, at the end of the step                           m/s
g(u)     impulse that the mechanism must give, against u            N s
G(u)     its slope, a mass                                          kg
θ        1: the slope itself (Newton); 0: a bound on it that never overshoots (iteratively reweighted least squares)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, absolute, maximum, sqrt, where


@dataclass(frozen=True, eq=False)
class Hinge:
    """Pushes and never pulls: n(u) = (a − b u)₊ (c − d u)₊, a Hunt-Crossley spring where its end will be.

    With a gap φ, a stiffness k and a step h: a = −h k φ, b = h² k, c = 1, and d the dissipation. Where the gap will open faster
    than u, by σ, a = −h k (φ + h σ) and c = 1 − d σ.
    """

    a: Scalar
    b: Scalar
    d: Scalar
    c: Scalar = 1.0

    def push(self, u: Scalar) -> Scalar:
        """n, the impulse along u."""
        return maximum(self.a - self.b * u, 0.0) * maximum(self.c - self.d * u, 0.0)

    def push_and_slope(self, u: Scalar) -> tuple[Scalar, Scalar]:
        """n and −dn/du."""
        spring, damper = self.a - self.b * u, self.c - self.d * u
        s, c = maximum(spring, 0.0), maximum(damper, 0.0)
        return s * c, where(spring > 0.0, self.b * c, 0.0) + where(damper > 0.0, self.d * s, 0.0)


@dataclass(frozen=True, eq=False)
class Cone:
    """Pulls towards a velocity, as hard as `width` away from it, and no harder: g(x) = limit x / max(|x|, width).

    It is dry friction: `limit` is friction times normal impulse.
    """

    limit: Scalar
    width: Scalar

    def secant(self, square: Scalar) -> tuple[Scalar, Scalar]:
        """Of x with this square: g/x, and 1/|x| where it slides, else 0."""
        floor = self.width * self.width
        inverse = 1.0 / sqrt(maximum(square, floor))
        return self.limit * inverse, where(square > floor, inverse, 0.0)

    def at(self, x: Scalar, theta: Scalar) -> tuple[Scalar, Scalar]:
        """g and G in one dimension."""
        s, sliding = self.secant(x * x)
        return s * x, where(sliding > 0.0, s * (1.0 - theta), s)


@dataclass(frozen=True, eq=False)
class Drive:
    """Gives c − b u along u, but never more than `limit` either way: proportional-derivative control with a limited torque.

    With gains p and d, an error e and a step h: c = h p e, b = h² p + h d.
    """

    c: Scalar
    b: Scalar
    limit: Scalar

    def at(self, u: Scalar, theta: Scalar) -> tuple[Scalar, Scalar]:
        """g and G."""
        wanted = self.c - self.b * u
        size = absolute(wanted)
        free = size <= self.limit
        given = where(free, wanted, where(wanted > 0.0, self.limit, -self.limit))
        secant = self.b * self.limit / where(free, 1.0, size)
        return -given, where(free, self.b, (1.0 - theta) * secant)


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Σ a_k b_k."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)
