"""Spatial inertias, RBDA 2.12 and 7.1, in structured form: never a dense 6x6 matrix."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar
from articulated.spatial.matrix import Mat3, Sym3
from articulated.spatial.motion import Force, Motion, UnitMotion
from articulated.spatial.vector import Vec3


class RigidInertia:
    """Of one rigid body: mass m, first moment h = m c, and rotational inertia J about the origin, RBDA 2.63."""

    __slots__ = ("J", "h", "mass")

    def __init__(self, mass: Scalar, h: Vec3, J: Sym3):
        self.mass, self.h, self.J = mass, h, J

    def __add__(self, other: RigidInertia) -> RigidInertia:
        return RigidInertia(self.mass + other.mass, self.h + other.h, self.J + other.J)

    def __matmul__(self, v: Motion) -> Force:
        """The momentum of a body that moves with v."""
        return Force(
            self.J @ v.angular + self.h.cross(v.linear),
            v.linear * self.mass - self.h.cross(v.angular),
        )

    def gyroscopic(self, omega: Vec3) -> Force:
        """What it takes to keep the body turning at ω while its origin does not accelerate: (ω × J ω, ω × (ω × h))."""
        return Force(omega.cross(self.J @ omega), omega.cross_twice(self.h))

    def articulated(self) -> ArticulatedInertia:
        return ArticulatedInertia(self.J, Mat3.skew(self.h), Sym3.scaled_identity(self.mass))


@dataclass(slots=True, eq=False)
class ArticulatedInertia:
    """[[J, H], [Hᵀ, M]]: the inertia that a body shows while its subtree gives way, RBDA 7.1."""

    J: Sym3
    H: Mat3
    M: Sym3

    @staticmethod
    def zero() -> ArticulatedInertia:
        return ArticulatedInertia(Sym3.zero(), Mat3.zero(), Sym3.zero())

    @staticmethod
    def of(scalars: Sequence[Scalar]) -> ArticulatedInertia:
        """From its scalars, in order."""
        return ArticulatedInertia(Sym3(*scalars[:6]), Mat3.of([scalars[k : k + 3] for k in (6, 9, 12)]), Sym3(*scalars[15:]))

    def __iter__(self) -> Iterator[Scalar]:
        yield from self.J
        for row in self.H.rows:
            yield from row
        yield from self.M

    def __add__(self, other: ArticulatedInertia) -> ArticulatedInertia:
        return ArticulatedInertia(self.J + other.J, self.H + other.H, self.M + other.M)

    def __matmul__(self, a: Motion) -> Force:
        if isinstance(a, UnitMotion):
            return self._column(a.axis)
        return Force(
            self.J @ a.angular + self.H @ a.linear,
            self.H.transpose_times(a.angular) + self.M @ a.linear,
        )

    def _column(self, k: int) -> Force:
        if k < 3:
            return Force(self.J.column(k), self.H.rows[k])
        return Force(self.H.column(k - 3), self.M.column(k - 3))

    def minus_outer(self, U: Force, Ud: Force) -> ArticulatedInertia:
        """IA − U D⁻¹ Uᵀ, RBDA 7.26, for one coordinate: `Ud` is U/D."""
        return ArticulatedInertia(
            self.J.minus_outer(U.angular, Ud.angular),
            self.H - Mat3.outer(U.angular, Ud.linear),
            self.M.minus_outer(U.linear, Ud.linear),
        )

    def without(self, direction: UnitMotion) -> ArticulatedInertia:
        """The same where it is known that this direction meets no inertia: its row and column are exactly zero."""
        k = direction.axis
        if k < 3:
            rows = [Vec3.zero() if i == k else row for i, row in enumerate(self.H.rows)]
            return ArticulatedInertia(self.J.without(k), Mat3(*rows), self.M)
        kept = [[0.0 if j == k - 3 else row[j] for j in range(3)] for row in self.H.rows]
        return ArticulatedInertia(self.J, Mat3.of(kept), self.M.without(k - 3))
