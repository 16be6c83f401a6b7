"""Derivatives along a direction: numbers x + x′ε with ε² = 0 (Griewank and Walther, Evaluating Derivatives, 2008, 3.1).

A law of force that is computed with them gives its change along a direction besides itself, exactly, over any scalars.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from articulated import scalar
from articulated.scalar import Nested, Scalar, flatten, rebuilt


@dataclass(frozen=True, eq=False)
class Mask:
    """Whether something holds of a dual's value."""

    holds: Any

    def __and__(self, other: Any) -> Mask:
        return Mask(self.holds & _mask(other))

    __rand__ = __and__

    def where(self, a: Any, b: Any) -> Dual:
        """As `scalar.where`."""
        a, b = Dual.of(a), Dual.of(b)
        return Dual(scalar.where(self.holds, a.value, b.value), scalar.where(self.holds, a.change, b.change))

    def given(self, value: Callable[[], Nested], otherwise: Nested) -> Nested:
        """As `scalar.given`."""
        parts = zip(flatten(value()), flatten(otherwise), strict=True)
        return rebuilt(otherwise, iter([self.where(a, b) for a, b in parts]))


class Dual:
    """A scalar and its change.

    Attributes:
        value, change: x and x′, scalars.
    """

    __slots__ = ("change", "value")
    __array_ufunc__ = None  # an array leaves arithmetic to it

    def __init__(self, value: Scalar, change: Scalar):
        self.value, self.change = value, change

    @staticmethod
    def of(x: Any) -> Dual:
        """A scalar as a dual; one that is none does not change."""
        return x if isinstance(x, Dual) else Dual(x, 0.0)

    def __add__(self, other: Any) -> Dual:
        b = Dual.of(other)
        return Dual(self.value + b.value, self.change + b.change)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.change)

    def __sub__(self, other: Any) -> Dual:
        return self + -Dual.of(other)

    def __rsub__(self, other: Any) -> Dual:
        return Dual.of(other) + -self

    def __mul__(self, other: Any) -> Dual:
        b = Dual.of(other)
        return Dual(self.value * b.value, self.change * b.value + self.value * b.change)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        b = Dual.of(other)
        value = self.value / b.value
        return Dual(value, (self.change - value * b.change) / b.value)

    def __rtruediv__(self, other: Any) -> Dual:
        return Dual.of(other) / self

    def __pow__(self, n: int) -> Dual:
        return Dual(self.value**n, self.change * (n * self.value ** (n - 1)))

    def __lt__(self, other: Any) -> Mask:
        return Mask(self.value < Dual.of(other).value)

    def __le__(self, other: Any) -> Mask:
        return Mask(self.value <= Dual.of(other).value)

    def __gt__(self, other: Any) -> Mask:
        return Mask(self.value > Dual.of(other).value)

    def __ge__(self, other: Any) -> Mask:
        return Mask(self.value >= Dual.of(other).value)

    def sqrt(self) -> Dual:
        root = scalar.sqrt(self.value)
        return Dual(root, self.change * scalar.reciprocal(2.0 * root))

    def sin(self) -> Dual:
        return Dual(scalar.sin(self.value), self.change * scalar.cos(self.value))

    def cos(self) -> Dual:
        return Dual(scalar.cos(self.value), -(self.change * scalar.sin(self.value)))

    def exp(self) -> Dual:
        value = scalar.exp(self.value)
        return Dual(value, self.change * value)

    def log(self) -> Dual:
        return Dual(scalar.log(self.value), self.change / self.value)

    def absolute(self) -> Dual:
        return (self < 0.0).where(-self, self)

    def atan2(self, y: Any, x: Any) -> Dual:
        """The angle of the point (x, y)."""
        y, x = Dual.of(y), Dual.of(x)
        square = x.value * x.value + y.value * y.value
        return Dual(scalar.atan2(y.value, x.value), (x.value * y.change - y.value * x.change) / square)


def changes(function: Callable[[Nested], Nested], at: Nested, along: Sequence[Scalar]) -> Nested:
    """How what a function makes of something changes along a direction: one number for each scalar in it."""
    moving = rebuilt(at, iter([Dual(x, dx) for x, dx in zip(flatten(at), along, strict=True)]))
    made = function(moving)
    return rebuilt(made, iter([Dual.of(x).change for x in flatten(made)]))


def _mask(x: Any) -> Any:
    return x.holds if isinstance(x, Mask) else x
