"""Rotations over scalars: about an axis, from and to quaternions (xyzw), exponential and logarithm.

Nothing here divides by zero or branches on a value: near zero rotation, `where` takes a series instead.
"""

from __future__ import annotations

from collections.abc import Sequence

from articulated.scalar import Scalar, atan2, cos, sin, sqrt, where
from articulated.spatial.matrix import Mat3
from articulated.spatial.turns import Turns
from articulated.spatial.vector import Vec3

_SMALL_SQUARE = 1e-4
"""Below this squared angle the series in use here, cut after the sixth power, are exact to rounding."""


def rotation_about_z(angle: Scalar) -> Turns:
    """The rotation by `angle` [rad] about z."""
    return Turns([(2, cos(angle), sin(angle))])


def rotation_about(axis: Vec3, angle: Scalar) -> Mat3:
    """The rotation by `angle` [rad] about a constant unit axis (Rodrigues)."""
    c, s = cos(angle), sin(angle)
    k = axis * (1.0 - c)
    return Mat3(
        Vec3(c + k.x * axis.x, k.x * axis.y - s * axis.z, k.x * axis.z + s * axis.y),
        Vec3(k.y * axis.x + s * axis.z, c + k.y * axis.y, k.y * axis.z - s * axis.x),
        Vec3(k.z * axis.x - s * axis.y, k.z * axis.y + s * axis.x, c + k.z * axis.z),
    )


def rotation_of_quaternion(quat_xyzw: Sequence[Scalar]) -> Mat3:
    """The rotation of a unit quaternion. RBDA 4.12, p. 85; differs: the scalar part is last and R is child-to-parent."""
    x, y, z, w = quat_xyzw
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return Mat3(
        Vec3(1.0 - (yy + zz), xy - wz, xz + wy),
        Vec3(xy + wz, 1.0 - (xx + zz), yz - wx),
        Vec3(xz - wy, yz + wx, 1.0 - (xx + yy)),
    )


def quaternion_product(a_xyzw: Sequence[Scalar], b_xyzw: Sequence[Scalar]) -> list[Scalar]:
    """The Hamilton product a b: first rotate by b, then by a."""
    ax, ay, az, aw = a_xyzw
    bx, by, bz, bw = b_xyzw
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def quaternion_conjugate(quat_xyzw: Sequence[Scalar]) -> list[Scalar]:
    """The inverse of a unit quaternion."""
    x, y, z, w = quat_xyzw
    return [-x, -y, -z, w]


def quaternion_normalized(quat_xyzw: Sequence[Scalar]) -> list[Scalar]:
    """The unit quaternion in this direction."""
    x, y, z, w = quat_xyzw
    scale = 1.0 / sqrt(x * x + y * y + z * z + w * w)
    return [x * scale, y * scale, z * scale, w * scale]


def quaternion_exp(rotation: Vec3) -> list[Scalar]:
    """The unit quaternion of a rotation vector [rad]."""
    square = rotation.dot(rotation)
    small = square < _SMALL_SQUARE
    angle = sqrt(where(small, 1.0, square))
    series = 0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0 - square * (1.0 / 645120.0)))
    half_sinc = where(small, series, sin(0.5 * angle) / angle)
    c = where(small, 1.0 - square * (0.125 - square * (1.0 / 384.0 - square * (1.0 / 46080.0))), cos(0.5 * angle))
    return [rotation.x * half_sinc, rotation.y * half_sinc, rotation.z * half_sinc, c]


def quaternion_log(quat_xyzw: Sequence[Scalar]) -> Vec3:
    """The rotation vector of a unit quaternion [rad], at most π long: q and −q give the same."""
    x, y, z, w = quat_xyzw
    square = x * x + y * y + z * z
    small = square < _SMALL_SQUARE
    s = sqrt(where(small, 1.0, square))
    c = where(w < 0.0, -w, w)
    # 2 asin(s)/s for small s, sign of w apart
    series = 2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0)))
    factor = where(small, series, 2.0 * atan2(s, c) / s)
    factor = where(w < 0.0, -factor, factor)
    return Vec3(x * factor, y * factor, z * factor)


def exp_translation(rotation: Vec3, translation: Vec3) -> Vec3:
    """V(ω) v: where a body that turns by ω while it moves by v in its own axes ends up (the translation of exp in SE(3)).

    V = 1 + (1 − cos θ)/θ² ω× + (θ − sin θ)/θ³ (ω×)²; Murray, Li, Sastry 1994, eq. 2.36, unnormalised.
    """
    square = rotation.dot(rotation)
    small = square < _SMALL_SQUARE
    theta2 = where(small, 1.0, square)
    theta = sqrt(theta2)
    half_sine = sin(0.5 * theta)
    b = where(small, _series_b(square), 2.0 * half_sine * half_sine / theta2)
    c = where(small, _series_c(square), (theta - sin(theta)) / (theta2 * theta))
    turn = rotation.cross(translation)
    return translation + turn * b + rotation.cross(turn) * c


def log_translation(rotation: Vec3, displacement: Vec3) -> Vec3:
    """V(ω)⁻¹ p, the inverse of `exp_translation`: 1 − ω×/2 + (1/θ² − cot(θ/2)/(2θ)) (ω×)²."""
    square = rotation.dot(rotation)
    small = square < _SMALL_SQUARE
    theta2 = where(small, 1.0, square)
    half = 0.5 * sqrt(theta2)
    closed = (1.0 - half * cos(half) / sin(half)) / theta2
    series = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0))
    d = where(small, series, closed)
    turn = rotation.cross(displacement)
    return displacement - turn * 0.5 + rotation.cross(turn) * d


def _series_b(square: Scalar) -> Scalar:
    return 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square * (1.0 / 40320.0)))


def _series_c(square: Scalar) -> Scalar:
    return 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square * (1.0 / 362880.0)))
