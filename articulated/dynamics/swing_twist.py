"""How far a ball joint is from its limits, and which way leads away from them; over scalars. See `rig.swing_twist`.

symbol    meaning                                                                       unit
R, ω      turn of the child in the joint frame, and its velocity in the child           –, rad/s
a, u, w   twist axis, and the two directions across it, in the joint frame
d         R a, where the axis points; s and c are sine and cosine of its angle θ to a
t         tilt: θ times the direction in which d lies, along u and w                    rad
F         Σ (t_i / α_i)², 1 on the cone, α the half-axes of this quarter of it
n         ½ dF/dω: half the gradient of F over turns of the child
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from articulated.rig.swing_twist import SwingTwist
from articulated.scalar import Scalar, atan2, cos, maximum, sin, sqrt, where
from articulated.spatial import Vec3
from articulated.spatial.rotation import rotation_of_quaternion

_SMALL = 1e-3
"""Below this square of s, series take over: as good as rounding."""
_BACK = 1e-8
"""Likewise where a points straight back: there nothing is exact."""
_NARROW = 1e-3
"""A half-axis of the cone is at least this long [rad]."""
_CENTER = 1e-2
"""A gradient shorter than this is that of a joint far inside."""
_FOLDED = 0.03
"""Square of the cosine of half the swing below which a twist says less and less: 160 degrees."""

Stop = tuple[Vec3, tuple[tuple[float, Scalar], ...]]
"""A direction in the child along which ω leads to stops or away, and of each stop its sign, and the room left [rad]."""


def stops_of(limits: SwingTwist, quat_xyzw: Sequence[Scalar]) -> list[Stop]:
    """Of a joint's cone, then of its twist; none of what is not limited."""
    found: list[Stop] = []
    if limits.swings:
        found.append(_cone(limits, quat_xyzw))
    if limits.twists:
        found.append(_twist(limits, quat_xyzw))
    return found


def tilt_and_twist(limits: SwingTwist, quat_xyzw: Sequence[Scalar]) -> tuple[Scalar, Scalar, Scalar]:
    """t along u and w, and the twist, from -π to π about the middle of its range [rad]."""
    R = rotation_of_quaternion(quat_xyzw)
    m_u, m_w, _, g, _ = _tilted(R @ _axes(limits)[2], limits)
    return g * m_u, g * m_w, _turned(limits, quat_xyzw) + 0.5 * sum(limits.twist)


def _cone(limits: SwingTwist, quat_xyzw: Sequence[Scalar]) -> Stop:
    """The distance is (1 − F)/2 over the length of n: to first order that to the nearest point of the cone."""
    u, w, a = _axes(limits)
    R = rotation_of_quaternion(quat_xyzw)
    d = R @ a
    m_u, m_w, F, g, slope = _tilted(d, limits)
    along = Vec3.zero()
    for m, axis, ends in ((m_u, u, limits.swing[:2]), (m_w, w, limits.swing[2:])):
        half = where(m > 0.0, max(ends[0], _NARROW), max(ends[1], _NARROW))
        part = g * m / (half * half)
        along = along + (axis * g + a * (slope * m)) * part
    n = R.transpose_times(d.cross(along))
    scale = 1.0 / sqrt(maximum(n.dot(n), _CENTER * _CENTER))
    return n * scale, ((-1.0, (0.5 * (1.0 - F)) * scale),)


def _tilted(d: Vec3, limits: SwingTwist) -> tuple[Scalar, Scalar, Scalar, Scalar, Scalar]:
    """s along u and along w, F, g = θ/s, and g' = dg/dc."""
    u, w, a = _axes(limits)
    m_u, m_w, c = d.dot(u), d.dot(w), d.dot(a)
    behind = c < 0.0
    m_u = where(behind, where(m_u * m_u + m_w * m_w < _BACK, math.sqrt(_BACK), m_u), m_u)  # straight back: towards u, say
    square = m_u * m_u + m_w * m_w
    small = where(behind, 0.0, where(square < _SMALL, 1.0, 0.0)) > 0.5
    safe = where(small, 1.0, square)
    s = sqrt(safe)
    series = 1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (5.0 / 112.0 + square * (35.0 / 1152.0))))
    g = where(small, series, atan2(s, c) / s)
    bend = 1.0 / 3.0 + square * (2.0 / 15.0 + square * (8.0 / 105.0 + square * (16.0 / 315.0)))
    slope = -where(small, bend, (1.0 - g * c) / safe)
    F = 0.0
    for m, ends in ((m_u, limits.swing[:2]), (m_w, limits.swing[2:])):
        part = g * m / where(m > 0.0, max(ends[0], _NARROW), max(ends[1], _NARROW))
        F = F + part * part
    return m_u, m_w, F, g, slope


def _twist(limits: SwingTwist, quat_xyzw: Sequence[Scalar]) -> Stop:
    """The twist is 2 atan2(v·a, w) for a quaternion (v, w); where the joint is folded back, its stops give way."""
    _, _, a = _axes(limits)
    v, w = Vec3.of(quat_xyzw[:3]), quat_xyzw[3]
    p = v.dot(a)
    square = p * p + w * w
    direction = ((a * w + a.cross(v)) * w + v * p) * (1.0 / maximum(square, _FOLDED))
    twist, half = _turned(limits, quat_xyzw), 0.5 * (limits.twist[1] - limits.twist[0])
    loose = half + 2.0 * math.pi * maximum(1.0 - square * (1.0 / _FOLDED), 0.0)
    return direction, ((1.0, loose + twist), (-1.0, loose - twist))


def _turned(limits: SwingTwist, quat_xyzw: Sequence[Scalar]) -> Scalar:
    """The twist away from the middle of its range, from -π to π: q and −q are the same."""
    _, _, a = _axes(limits)
    p, w = Vec3.of(quat_xyzw[:3]).dot(a), quat_xyzw[3]
    middle = 0.25 * sum(limits.twist)
    if middle:
        s, c = sin(middle), cos(middle)
        p, w = p * c - w * s, w * c + p * s
    sign = where(w < 0.0, -1.0, 1.0)
    return 2.0 * atan2(p * sign, w * sign)


def _axes(limits: SwingTwist) -> tuple[Vec3, Vec3, Vec3]:
    """u, w and a; exact where they are axes of the frame, so that products with them vanish."""
    u, w, a = (Vec3.of([float(x) for x in column]) for column in limits.frame.T.round(15))
    return u, w, a
