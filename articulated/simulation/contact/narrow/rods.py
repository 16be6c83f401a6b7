"""Balls and capsules against each other: lines between two ends, with a radius.

Lines that are almost parallel have their nearest points now at one end, now at the other: two capsules that lie on each other
would rock. So they also touch where their overlap begins and where it ends.
"""

from __future__ import annotations

from articulated.scalar import Scalar, either, maximum, sqrt, where
from articulated.simulation.contact.narrow.lines import clamped, nearest
from articulated.simulation.contact.narrow.placed import Rod, Touch
from articulated.spatial import Vec3

_TINY = 1e-24


def rod_rod(a: Rod, b: Rod) -> list[Touch]:
    """The points of two rods: one if any of them is a ball, else three."""
    if a.half is None or b.half is None:
        x = a.center if a.half is None else _along(a, _nearest(a, b.center))
        y = b.center if b.half is None else _along(b, _nearest(b, a.center))
        return [_touch(a, b, x, y)]
    s, t = _closest(a, b)
    touches = [_touch(a, b, _along(a, s), _along(b, t))]
    for side in (-1.0, 1.0):  # where b's ends stand beside a
        x = _along(a, _nearest(a, _along(b, side)))
        touches.append(_touch(a, b, x, _along(b, _nearest(b, x))))
    return touches


def touch_between(x: Vec3, y: Vec3, radius_a: float, radius_b: float, otherwise: Vec3) -> Touch:
    """Of two balls about x and y; where these are one point, the normal is a unit vector along `otherwise`."""
    apart = x - y
    square = apart.dot(apart)
    distance = sqrt(square)
    is_apart = square > _TINY
    scale = 1.0 / where(is_apart, distance, sqrt(maximum(otherwise.dot(otherwise), _TINY)))
    normal = either(is_apart, apart, otherwise) * scale
    size = distance - (radius_a + radius_b)
    return Touch(size, normal, y + normal * (radius_b + 0.5 * size))


def _touch(a: Rod, b: Rod, x: Vec3, y: Vec3) -> Touch:
    across = Vec3(0.0, 0.0, 1.0) if a.half is None or b.half is None else a.half.cross(b.half)
    return touch_between(x, y, a.radius, b.radius, across)


def _along(rod: Rod, s: Scalar) -> Vec3:
    """The point of its line that is this part of the way from its middle to an end."""
    assert rod.half is not None
    return rod.center + rod.half * s


def _nearest(rod: Rod, point: Vec3) -> Scalar:
    assert rod.half is not None
    return clamped(rod.half.dot(point - rod.center) / rod.half.dot(rod.half))


def _closest(a: Rod, b: Rod) -> tuple[Scalar, Scalar]:
    """Where the nearest points of two lines are."""
    assert a.half is not None
    assert b.half is not None
    r = a.center - b.center
    aa, bb, ab = a.half.dot(a.half), b.half.dot(b.half), a.half.dot(b.half)
    ar, br = a.half.dot(r), b.half.dot(r)
    return nearest(aa, bb, ab, ar, br)
