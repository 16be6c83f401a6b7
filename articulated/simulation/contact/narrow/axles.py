"""Two cylinders: side by side, across each other, one standing on the other, rim on rim.

The normal is that of five along which they are farthest apart: the axis of each; away from each one's side, where its axis is
nearest to the other cylinder; and square to both rims where these meet. Along one of the first two an end of one is on the
other: the lowest line of each, and two lines across the smaller end, are clipped to the other's end. Else they touch with
their sides, in up to three points as two capsules do, or with their rims, in one. The normals of sides and ends are exact. Two
rims meet on the line in which the planes of the two ends cut each other: exactly there if they touch, and near it if they are
a little apart or in each other. All is in the axes of the world: a cylinder has no others than its own.

symbol   meaning
c        from the middle of b to that of a
n        normal, from b to a
t        place on a cylinder's axis, −1 and 1 at its ends
k        cosine between the two axes
"""

from __future__ import annotations

from articulated.scalar import Scalar, absolute, either, given, least, maximum, minimum, sqrt, where
from articulated.simulation.contact.narrow.arcs import Axis
from articulated.simulation.contact.narrow.cylinders import Course, ball, distance, reach
from articulated.simulation.contact.narrow.lines import clamped
from articulated.simulation.contact.narrow.placed import FAR, UPRIGHT, Roller, Touch
from articulated.simulation.contact.narrow.reduction import ASKEW, Across, Place, four
from articulated.simulation.contact.narrow.rims import lowest
from articulated.spatial import Vec3

_PREFERENCE = 1e-6
"""How much farther apart they must be along an axis for it to take the place of one before it [m]."""
_PREFERENCE_OF_A = 1e-5
"""For that away from b's side to take the place of that away from a's: if these touch each other, they are one [m]."""
_SLACK = 0.05
"""By what part of the smaller radius they may be less far apart along it, if there is no point along that one."""
_FLUSH = 0.1
"""Cosine between a side and the normal from which on it is no longer the side that touches."""
_PARALLEL = 1e-6
_TINY = 1e-24


def roller_roller(a: Roller, b: Roller) -> list[Touch]:
    """The points of two cylinders, four of them; those that are not there are far."""
    c = a.center - b.center
    end, end_of_a = _of_end(a, b, c, b.axis), _of_end(a, b, c, a.axis)
    end = either(end_of_a.size > end.size + _PREFERENCE, end_of_a, end)
    (of_a, t_a), (of_b, t_b) = _of_side(a, b, c, 1.0), _of_side(b, a, c, -1.0)
    is_b = of_b.size > of_a.size + _PREFERENCE_OF_A
    side = either(is_b, of_b, of_a)
    n = either(side.size > end.size, side.normal, end.normal)
    rim, point = _of_rims(a, b, c, (_end(a, -n, t_a), _end(b, n, t_b)))
    is_rim = rim.size > side.size + _PREFERENCE
    side = either(is_rim, rim, side)

    far = [Touch(FAR, end.normal, b.center)] * 4
    on_end = given(side.size <= end.size + _PREFERENCE, lambda: _by_ends(a, b, end), far)
    nothing = least([touch.size for touch in on_end]) > 0.5 * FAR
    is_side = side.size > end.size + where(nothing, -(_SLACK * minimum(a.radius, b.radius)), _PREFERENCE)
    side = Axis(maximum(side.size, end.size), side.normal)  # both tell how far they are apart at least

    def by_sides() -> list[Touch]:
        rod, other, t, turn = either(is_b, (b, a, t_b, -1.0), (a, b, t_a, 1.0))
        found = _by_sides(rod, other, t, side, turn)
        near = Touch(side.size, side.normal, either(is_rim, point, found[0].point))
        rest = [Touch(where(is_rim, FAR, touch.size), touch.normal, touch.point) for touch in found[1:]]
        return [near, *rest, Touch(FAR, side.normal, near.point)]

    return given(is_side, by_sides, on_end)


def _of_end(a: Roller, b: Roller, c: Vec3, u: Vec3) -> Axis:
    """Along the axis of one."""
    along = u.dot(c)
    n = u * where(along < 0.0, -1.0, 1.0)
    return Axis(absolute(along) - reach(a, n) - reach(b, n), n)


def _of_side(rod: Roller, other: Roller, c: Vec3, turn: float) -> tuple[Axis, Scalar]:
    """Away from the side of one, towards a if `turn` is 1; and the place on its axis that is nearest to the other."""
    course = Course.of(other, rod.center, rod.axis * rod.half)
    t = course.nearest(other.radius, other.half, course.middle(other.half))
    _, normal = distance(other, rod.center + rod.axis * (rod.half * t))
    n = normal * turn
    return Axis(n.dot(c) - reach(rod, n) - reach(other, n), n), t


def _end(roller: Roller, n: Vec3, t: Scalar) -> Vec3:
    """The middle of the end that looks along a normal, or if none does, is at the end of the axis where t is."""
    cosine = roller.axis.dot(n)
    side = where(absolute(cosine) > _FLUSH, cosine, t)
    return roller.center + roller.axis * where(side < 0.0, -roller.half, roller.half)


def _of_rims(a: Roller, b: Roller, c: Vec3, ends: tuple[Vec3, Vec3]) -> tuple[Axis, Vec3]:
    """Square to the rims of two ends, where they are nearest on the line in both planes; and the middle of that."""
    k = a.axis.dot(b.axis)
    square = maximum(1.0 - k * k, _PARALLEL)
    e = a.axis.cross(b.axis) * (1.0 / sqrt(square))
    apart = ends[1] - ends[0]
    turn = where(e.dot(apart) < 0.0, -1.0, 1.0)
    tangents, points = [], []
    for roller, other, end, sign in ((a, b, ends[0], 1.0), (b, a, ends[1], -1.0)):
        far = sign * (other.axis.dot(apart) / square)
        chord = sqrt(maximum(roller.radius * roller.radius - far * far * square, 0.0))
        radial = (other.axis - roller.axis * k) * far + e * (sign * turn * chord)
        tangents.append(roller.axis.cross(radial))
        points.append(end + radial)
    n = tangents[0].cross(tangents[1])
    n = n * (where(n.dot(c) < 0.0, -1.0, 1.0) / sqrt(maximum(n.dot(n), _TINY)))
    size = n.dot(c) - reach(a, n) - reach(b, n)
    is_normal = n.dot(n) > 0.5
    return Axis(where(is_normal, size, -FAR), either(is_normal, n, a.axis)), (points[0] + points[1]) * 0.5


def _by_sides(rod: Roller, other: Roller, t: Scalar, side: Axis, turn: Scalar) -> list[Touch]:
    """Where the side of one touches: nearest to the other, and where the part beside that begins and ends."""
    n, half = side.normal * turn, rod.axis * rod.half
    found = [Touch(side.size, side.normal, rod.center + half * t - n * (rod.radius + 0.5 * side.size))]
    begin, end = Course.of(other, rod.center, half).beside(other.half)
    begin, end = maximum(begin, -1.0), minimum(end, 1.0)
    for place in (begin, end):
        touch = ball(other, rod.center + half * clamped(place), rod.radius)
        there = (begin < end) & (absolute(touch.normal.dot(rod.axis)) < _FLUSH)
        found.append(Touch(where(there, touch.size, FAR), touch.normal * turn, touch.point))
    return found


def _by_ends(a: Roller, b: Roller, axis: Axis) -> list[Touch]:
    """Where the lower end of a, or the upper end of b, is on the other."""
    n = axis.normal
    across = Across.of(n)
    places = [*_on_end(*_line(a, n), b, across, 1.0), *_on_end(*_line(b, -n), a, across, -1.0)]
    is_a = a.radius <= b.radius
    small, large, side = either(is_a, (a, b, 1.0), (b, a, -1.0))
    along = small.axis.dot(n) * side
    end = small.center - small.axis * where(along < 0.0, -small.half, small.half)
    for direction in (across.u, across.v + across.u * ASKEW):
        x = direction - small.axis * small.axis.dot(direction)
        x = x * (small.radius / sqrt(maximum(x.dot(x), _TINY)))
        places += [place.only(absolute(along) > UPRIGHT) for place in _on_end(end, x, large, across, side)]
    return [Touch(place.size, n, across.vector(place.point)) for place in four(places)]


def _line(roller: Roller, n: Vec3) -> tuple[Vec3, Vec3]:
    """Middle and half of the line along its side that is lowest."""
    half = roller.axis * roller.half
    return lowest(roller, n) + half * where(roller.axis.dot(n) < 0.0, -1.0, 1.0), half


def _on_end(middle: Vec3, half: Vec3, roller: Roller, across: Across, side: Scalar) -> list[Place]:
    """The ends of a line that is clipped to the end of a cylinder below it (side 1) or above (−1), if that stands."""
    cosine = roller.axis.dot(across.n) * side
    is_upright, up = absolute(cosine) > UPRIGHT, where(cosine < 0.0, -1.0, 1.0)
    rate = 1.0 / where(is_upright, absolute(cosine), 1.0)
    course, places = Course.of(roller, middle, half), []
    begin, end = course.over(roller.radius)
    there = (maximum(begin, -1.0) <= minimum(end, 1.0)) & is_upright
    for t in (begin, end):
        t = clamped(t)
        size = ((course.z[0] + course.z[1] * t) * up - roller.half) * rate
        p = across.of_vector(middle + half * t)
        places.append(Place(size, Vec3(p.x, p.y, p.z - (0.5 * side) * size)).only(there))
    return places
