"""Rotations as turns about coordinate axes, one after the other: a hinge is one, and any constant rotation is three.

About an axis a vector turns with 4 multiply-adds where a matrix takes 9, a symmetric matrix with 11 where two products take 45.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import overload

from articulated.scalar import Scalar
from articulated.spatial.matrix import Mat3, Sym3
from articulated.spatial.vector import Vec3

_ROUNDING = 1e-15

Turn = tuple[int, Scalar, Scalar]
"""An axis (0, 1, 2 for x, y, z) and cosine and sine of the angle."""


class Turns:
    """The rotation R = R₁ R₂ … of turns about coordinate axes. It can be used as a `Mat3` that is a rotation can."""

    __slots__ = ("turns",)

    def __init__(self, turns: Sequence[Turn]):
        self.turns = tuple(turns)

    @staticmethod
    def of(matrix: Sequence[Sequence[float]]) -> Turns:
        """A constant rotation as turns about z, x and z. What is within rounding of a right angle is one exactly."""
        (a, _, x), (b, _, y), (u, _, w) = matrix
        tilt = math.hypot(x, y)
        c, s = (-y / tilt, x / tilt) if tilt > _ROUNDING else (1.0, 0.0)
        # the last turn is what the first two leave: read off the last row, it would be lost where the tilt is small
        c_last, s_last = c * a + s * b, w * (c * b - s * a) + tilt * u
        size = math.hypot(c_last, s_last)
        return _about((2, c, s), (0, w, tilt), (2, c_last / size, s_last / size))

    def matrix(self) -> Mat3:
        """R as a matrix."""
        return Mat3.identity() @ self

    @property
    def T(self) -> Turns:
        """The inverse."""
        return Turns([(axis, c, -s) for axis, c, s in reversed(self.turns)])

    @overload
    def __matmul__(self, b: Vec3) -> Vec3: ...
    @overload
    def __matmul__(self, b: Mat3) -> Mat3: ...
    @overload
    def __matmul__(self, b: Turns) -> Turns: ...
    def __matmul__(self, b):
        if isinstance(b, Vec3):
            for axis, c, s in reversed(self.turns):
                b = _turned(b, axis, c, s)
            return b
        if isinstance(b, Mat3):
            return Mat3(*(self @ column for column in b.T.rows)).T
        if self.turns and b.turns and self.turns[-1][0] == b.turns[0][0]:  # two turns about one axis are one
            (axis, c0, s0), (_, c1, s1) = self.turns[-1], b.turns[0]
            return Turns([*self.turns[:-1], (axis, c0 * c1 - s0 * s1, s0 * c1 + c0 * s1), *b.turns[1:]])
        return Turns([*self.turns, *b.turns])

    def transpose_times(self, b: Vec3) -> Vec3:
        """Rᵀ b."""
        for axis, c, s in self.turns:
            b = _turned(b, axis, c, -s)
        return b

    def __rmatmul__(self, A: Mat3) -> Mat3:
        return Mat3(*(self.transpose_times(row) for row in A.rows))

    def conjugate(self, A: Mat3) -> Mat3:
        """R A Rᵀ."""
        for axis, c, s in reversed(self.turns):
            i, j, k = (axis + 1) % 3, (axis + 2) % 3, axis
            a = [list(row) for row in A.rows]
            b = [list(row) for row in A.rows]
            # double angles without their cosines: A_ii c² − (A_ij + A_ji) c s + A_jj s² is A_ii − s (…)
            mixed = s * (a[i][i] - a[j][j]) + c * (a[i][j] + a[j][i])
            b[i][i], b[j][j] = a[i][i] - s * mixed, a[j][j] + s * mixed
            b[i][j], b[j][i] = c * mixed - a[j][i], c * mixed - a[i][j]
            b[i][k], b[j][k] = c * a[i][k] - s * a[j][k], s * a[i][k] + c * a[j][k]
            b[k][i], b[k][j] = c * a[k][i] - s * a[k][j], s * a[k][i] + c * a[k][j]
            A = Mat3.of(b)
        return A

    def conjugate_symmetric(self, A: Sym3) -> Sym3:
        """R A Rᵀ, A symmetric."""
        return Sym3.upper(self.conjugate(A.as_matrix()))


def _about(*turns: Turn) -> Turns:
    """Constant turns, right angles made exact and turns by nothing left out."""
    exact = [(axis, _exact(c), _exact(s)) for axis, c, s in turns]
    return Turns([turn for turn in exact if turn[1:] != (1.0, 0.0)])


def _exact(x: float) -> float:
    return float(round(x)) if abs(x - round(x)) < _ROUNDING else x


def _turned(b: Vec3, axis: int, c: Scalar, s: Scalar) -> Vec3:
    if axis == 0:
        return Vec3(b.x, c * b.y - s * b.z, s * b.y + c * b.z)
    if axis == 1:
        return Vec3(c * b.x + s * b.z, b.y, c * b.z - s * b.x)
    return Vec3(c * b.x - s * b.y, s * b.x + c * b.y, b.z)
