"""Spatial motion and force vectors, RBDA ch. 2: (angular, linear), each in some body's axes about its origin."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar
from articulated.spatial.vector import Vec3


@dataclass(slots=True, eq=False)
class Force:
    """A spatial force or momentum: the couple about the origin, then the linear force."""

    angular: Vec3
    linear: Vec3

    @staticmethod
    def zero() -> Force:
        return Force(Vec3.zero(), Vec3.zero())

    @staticmethod
    def of(scalars: Sequence[Scalar]) -> Force:
        """From its scalars, in order."""
        return Force(Vec3.of(scalars[:3]), Vec3.of(scalars[3:]))

    def __iter__(self) -> Iterator[Scalar]:
        yield from self.angular
        yield from self.linear

    def __add__(self, f: Force) -> Force:
        return Force(self.angular + f.angular, self.linear + f.linear)

    def __sub__(self, f: Force) -> Force:
        return Force(self.angular - f.angular, self.linear - f.linear)

    def __mul__(self, s: Scalar) -> Force:
        return Force(self.angular * s, self.linear * s)


@dataclass(slots=True, eq=False)
class Motion:
    """A spatial velocity or acceleration: the angular part, then the linear part at the origin."""

    angular: Vec3
    linear: Vec3

    @staticmethod
    def zero() -> Motion:
        return Motion(Vec3.zero(), Vec3.zero())

    def __add__(self, m: Motion) -> Motion:
        return Motion(self.angular + m.angular, self.linear + m.linear)

    def __sub__(self, m: Motion) -> Motion:
        return Motion(self.angular - m.angular, self.linear - m.linear)

    def __mul__(self, s: Scalar) -> Motion:
        return Motion(self.angular * s, self.linear * s)

    def dot(self, f: Force) -> Scalar:
        """The power of a force on this velocity."""
        return self.angular.dot(f.angular) + self.linear.dot(f.linear)

    def cross(self, m: Motion) -> Motion:
        """v × m, RBDA 2.31."""
        return Motion(
            self.angular.cross(m.angular),
            self.angular.cross(m.linear) + self.linear.cross(m.angular),
        )

    def cross_force(self, f: Force) -> Force:
        """v ×* f, RBDA 2.32."""
        return Force(
            self.angular.cross(f.angular) + self.linear.cross(f.linear),
            self.angular.cross(f.linear),
        )


class UnitMotion(Motion):
    """A coordinate direction of motion: 0, 1, 2 turn about x, y, z; 3, 4, 5 move along them.

    Most joints move along such directions of their own body, where a product with S is a choice of a component.
    """

    __slots__ = ("axis",)

    def __init__(self, axis: int):
        unit = [0.0] * 6
        unit[axis] = 1.0
        super().__init__(Vec3.of(unit[:3]), Vec3.of(unit[3:]))
        self.axis = axis

    def __mul__(self, s: Scalar) -> Motion:
        part = [0.0, 0.0, 0.0]
        part[self.axis % 3] = s
        along = Vec3.of(part)
        return Motion(along, Vec3.zero()) if self.axis < 3 else Motion(Vec3.zero(), along)

    def dot(self, f: Force) -> Scalar:
        return f.angular[self.axis] if self.axis < 3 else f.linear[self.axis - 3]
