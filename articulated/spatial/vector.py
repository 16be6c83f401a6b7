"""Three-vectors over scalars."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar


@dataclass(slots=True, eq=False)
class Vec3:
    """A vector in three dimensions."""

    x: Scalar
    y: Scalar
    z: Scalar

    @staticmethod
    def zero() -> Vec3:
        return Vec3(0.0, 0.0, 0.0)

    @staticmethod
    def of(values: Sequence[Scalar]) -> Vec3:
        """The vector with these three components."""
        x, y, z = values
        return Vec3(x, y, z)

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.x, self.y, self.z))

    def __getitem__(self, k: int) -> Scalar:
        return (self.x, self.y, self.z)[k]

    def __add__(self, b: Vec3) -> Vec3:
        return Vec3(self.x + b.x, self.y + b.y, self.z + b.z)

    def __sub__(self, b: Vec3) -> Vec3:
        return Vec3(self.x - b.x, self.y - b.y, self.z - b.z)

    def __neg__(self) -> Vec3:
        return Vec3(-self.x, -self.y, -self.z)

    def __mul__(self, s: Scalar) -> Vec3:
        return Vec3(self.x * s, self.y * s, self.z * s)

    def dot(self, b: Vec3) -> Scalar:
        return self.x * b.x + self.y * b.y + self.z * b.z

    def cross(self, b: Vec3) -> Vec3:
        return Vec3(self.y * b.z - self.z * b.y, self.z * b.x - self.x * b.z, self.x * b.y - self.y * b.x)

    def cross_twice(self, b: Vec3) -> Vec3:
        """a × (a × b), as a (a·b) − b |a|²."""
        return self * self.dot(b) - b * self.dot(self)
