"""3x3 matrices over scalars: general (three rows) and symmetric (six numbers)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

from articulated.scalar import Scalar
from articulated.spatial.vector import Vec3


@dataclass(slots=True, eq=False)
class Mat3:
    """A general 3x3 matrix, kept as three rows. A rotation `R_AB` takes components in B to components in A."""

    row0: Vec3
    row1: Vec3
    row2: Vec3

    @property
    def rows(self) -> tuple[Vec3, Vec3, Vec3]:
        return self.row0, self.row1, self.row2

    @staticmethod
    def of(rows: Sequence[Sequence[Scalar]]) -> Mat3:
        return Mat3(*(Vec3.of(row) for row in rows))

    @staticmethod
    def identity() -> Mat3:
        return Mat3(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))

    @staticmethod
    def zero() -> Mat3:
        return Mat3(Vec3.zero(), Vec3.zero(), Vec3.zero())

    @staticmethod
    def skew(r: Vec3) -> Mat3:
        """r×, the matrix of the cross product: `skew(r) @ b == r.cross(b)`."""
        return Mat3(Vec3(0.0, -r.z, r.y), Vec3(r.z, 0.0, -r.x), Vec3(-r.y, r.x, 0.0))

    @staticmethod
    def outer(a: Vec3, b: Vec3) -> Mat3:
        return Mat3(b * a.x, b * a.y, b * a.z)

    @property
    def T(self) -> Mat3:
        return Mat3(self.column(0), self.column(1), self.column(2))

    def column(self, k: int) -> Vec3:
        a, b, c = self.rows
        return Vec3(a[k], b[k], c[k])

    def __add__(self, B: Mat3) -> Mat3:
        return Mat3(*(a + b for a, b in zip(self.rows, B.rows, strict=True)))

    def __sub__(self, B: Mat3) -> Mat3:
        return Mat3(*(a - b for a, b in zip(self.rows, B.rows, strict=True)))

    @overload
    def __matmul__(self, b: Vec3) -> Vec3: ...
    @overload
    def __matmul__(self, b: Mat3) -> Mat3: ...
    def __matmul__(self, b: Vec3 | Mat3) -> Vec3 | Mat3:
        if isinstance(b, Vec3):
            row0, row1, row2 = self.rows
            return Vec3(row0.dot(b), row1.dot(b), row2.dot(b))
        if not isinstance(b, Mat3):
            return NotImplemented
        columns = b.T.rows
        return Mat3(*(Vec3(*(row.dot(column) for column in columns)) for row in self.rows))

    def transpose_times(self, b: Vec3) -> Vec3:
        """Mᵀ b."""
        row0, row1, row2 = self.rows
        return Vec3(
            row0.x * b.x + row1.x * b.y + row2.x * b.z,
            row0.y * b.x + row1.y * b.y + row2.y * b.z,
            row0.z * b.x + row1.z * b.y + row2.z * b.z,
        )

    def times_transpose(self, B: Mat3) -> Mat3:
        """M Bᵀ."""
        return Mat3(*(Vec3(*(row.dot(other) for other in B.rows)) for row in self.rows))

    def conjugate(self, A: Mat3) -> Mat3:
        """M A Mᵀ."""
        return (self @ A).times_transpose(self)

    def conjugate_symmetric(self, A: Sym3) -> Sym3:
        """M A Mᵀ, A symmetric."""
        return Sym3.upper_of_product(self @ A.as_matrix(), self)


@dataclass(slots=True, eq=False)
class Sym3:
    """A symmetric 3x3 matrix: xx, xy, xz, yy, yz, zz."""

    xx: Scalar
    xy: Scalar
    xz: Scalar
    yy: Scalar
    yz: Scalar
    zz: Scalar

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.xx, self.xy, self.xz, self.yy, self.yz, self.zz))

    @staticmethod
    def of(rows: Sequence[Sequence[Scalar]]) -> Sym3:
        """The upper triangle of three rows."""
        return Sym3(rows[0][0], rows[0][1], rows[0][2], rows[1][1], rows[1][2], rows[2][2])

    @staticmethod
    def zero() -> Sym3:
        return Sym3(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    @staticmethod
    def scaled_identity(s: Scalar) -> Sym3:
        return Sym3(s, 0.0, 0.0, s, 0.0, s)

    @staticmethod
    def upper(A: Mat3) -> Sym3:
        """A matrix that is known to be symmetric."""
        a, b, c = A.rows
        return Sym3(a.x, a.y, a.z, b.y, b.z, c.z)

    @staticmethod
    def upper_of_product(A: Mat3, B: Mat3) -> Sym3:
        """A Bᵀ where it is known to be symmetric: only the upper triangle is computed."""
        a, b, c = A.rows
        x, y, z = B.rows
        return Sym3(a.dot(x), a.dot(y), a.dot(z), b.dot(y), b.dot(z), c.dot(z))

    def as_matrix(self) -> Mat3:
        return Mat3(self.column(0), self.column(1), self.column(2))

    def column(self, k: int) -> Vec3:
        if k == 0:
            return Vec3(self.xx, self.xy, self.xz)
        if k == 1:
            return Vec3(self.xy, self.yy, self.yz)
        return Vec3(self.xz, self.yz, self.zz)

    def __add__(self, b: Sym3) -> Sym3:
        return Sym3(self.xx + b.xx, self.xy + b.xy, self.xz + b.xz, self.yy + b.yy, self.yz + b.yz, self.zz + b.zz)

    def __sub__(self, b: Sym3) -> Sym3:
        return Sym3(self.xx - b.xx, self.xy - b.xy, self.xz - b.xz, self.yy - b.yy, self.yz - b.yz, self.zz - b.zz)

    def __matmul__(self, b: Vec3) -> Vec3:
        return Vec3(
            self.xx * b.x + self.xy * b.y + self.xz * b.z,
            self.xy * b.x + self.yy * b.y + self.yz * b.z,
            self.xz * b.x + self.yz * b.y + self.zz * b.z,
        )

    def minus_outer(self, a: Vec3, b: Vec3) -> Sym3:
        """A − a bᵀ, where b is a multiple of a."""
        return Sym3(
            self.xx - a.x * b.x,
            self.xy - a.x * b.y,
            self.xz - a.x * b.z,
            self.yy - a.y * b.y,
            self.yz - a.y * b.z,
            self.zz - a.z * b.z,
        )

    def without(self, k: int) -> Sym3:
        """The same with row and column k exactly zero."""
        if k == 0:
            return Sym3(0.0, 0.0, 0.0, self.yy, self.yz, self.zz)
        if k == 1:
            return Sym3(self.xx, 0.0, self.xz, 0.0, 0.0, self.zz)
        return Sym3(self.xx, self.xy, 0.0, self.yy, 0.0, 0.0)
