"""The normal along which a cylinder and a polyhedron are farthest apart, or least deep in each other.

It is that of four along which they are farthest apart: a face's; the cylinder's axis; square to that, away from an edge or a
corner; and away from an edge that the rim is near. These are all that can separate a cylinder and a polyhedron (for boxes:
Gottschalk, Lin and Manocha, OBBTree, 1996), but of the last two there are many, and one of each is tried. For the rim it is
the edge at that side of the best face which the cylinder's lowest point is beyond; its point nearest to the cylinder gives the
normal. There would be none if the edge were in the cylinder: so it is asked of a smaller one within, in which the edge is not.

All is in the polyhedron's axes.

symbol   meaning
c, u     the cylinder's middle and axis
n        normal, from the polyhedron to the cylinder
m        unit vector square to n
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from articulated.scalar import Scalar, either, given, least, maximum, minimum, sqrt, where
from articulated.simulation.contact.narrow.arcs import Axis, Side, best_of, farthest, sides
from articulated.simulation.contact.narrow.cylinders import Course, distance, reach
from articulated.simulation.contact.narrow.facets import TOLERANCE, clipped
from articulated.simulation.contact.narrow.placed import FAR, Roller
from articulated.simulation.contact.narrow.solids import Solid
from articulated.spatial import Vec3

_PREFERENCE = 1e-9
"""How much farther apart they must be along an axis for it to take the place of one before it [m]."""
_SMALLER = 2.5
"""By how many times the depth of an edge the cylinder from which its normal is taken is smaller."""
_ROUND, _MOST = 0.02, 0.9
"""And by which part of its size at least, and at most."""
_SLIGHT = 1e-12
_TINY = 1e-18


@dataclass(frozen=True, eq=False)
class Meeting:
    """A normal, and a point of an edge near the cylinder's rim that it may belong to.

    Attributes:
        axis: the normal, and how far apart they are along it.
        point: of the edge.
        on_edge: mask: whether it belongs to it.
    """

    axis: Axis
    point: Vec3
    on_edge: Scalar


def meeting_of(roller: Roller, solid: Solid) -> Meeting:
    """The normal, of a cylinder given in the polyhedron's axes."""
    face = best_of([Axis(face.n.dot(roller.center) - face.d - reach(roller, face.n), face.n) for face in solid.faces])
    best = face
    for axis in (_of_end(roller, solid.vertices), _of_side(roller, solid.vertices)):
        best = either(axis.size > best.size + _PREFERENCE, axis, best)
    corner = lowest(roller, face.normal)
    side = farthest(sides(solid, face, corner))
    none = Axis(-FAR, face.normal), corner
    axis, point = given(side.beyond > 0.0, lambda: _of_rim(roller, solid, face, side, corner), none)
    on_edge = axis.size > best.size + _PREFERENCE
    return Meeting(either(on_edge, axis, best), point, on_edge)


def lowest(roller: Roller, n: Vec3) -> Vec3:
    """The point of a cylinder that is farthest against a direction."""
    cosine = roller.axis.dot(n)
    across = n - roller.axis * cosine
    across = across * (roller.radius / sqrt(maximum(across.dot(across), _TINY)))
    return roller.center - across - roller.axis * where(cosine < 0.0, -roller.half, roller.half)


def _of_end(roller: Roller, vertices: Sequence[Vec3]) -> Axis:
    """Along the cylinder's axis."""
    u, middle = roller.axis, roller.axis.dot(roller.center)
    heights = [u.dot(x) for x in vertices]
    above, below = middle + least([-height for height in heights]), least(heights) - middle
    return Axis(maximum(above, below) - roller.half, either(above > below, u, -u))


def _of_side(roller: Roller, vertices: Sequence[Vec3]) -> Axis:
    """Square to the cylinder's axis.

    Seen along the axis, a normal away from the polyhedron's middle is turned, as in `arcs`: until a second corner is as near as
    the first, or the normal points from the first to the axis.
    """
    c, u = roller.center, roller.axis
    n = c - u * u.dot(c)
    square = n.dot(n)
    is_off = square > _SLIGHT
    n = n * (1.0 / sqrt(where(is_off, square, 1.0)))
    m = u.cross(n)
    height, along = n.dot(c), m.dot(c)
    points = [(height - n.dot(x), along - m.dot(x)) for x in vertices]
    h, w = points[0]
    for x, y in points[1:]:
        h, w = either(x < h, (x, y), (h, w))
    turn = where(w < 0.0, -1.0, 1.0)
    w = w * turn
    is_beyond = w > _SLIGHT
    r = h / where(is_beyond, w, 1.0)
    for x, y in points:
        r = maximum(r, (w - y * turn) / (x - h + _SLIGHT))
    r = where(is_beyond, r, 1.0 / _SLIGHT)
    scale = 1.0 / sqrt(1.0 + r * r)
    size = (h * r + w) * scale - roller.radius
    return Axis(where(is_off, size, -FAR), (n * r + m * turn) * scale)


def _of_rim(roller: Roller, solid: Solid, face: Axis, side: Side, corner: Vec3) -> tuple[Axis, Vec3]:
    """Away from an edge: the side of a face that the cylinder's lowest point is beyond, where other faces leave of it."""
    n, size = face.normal, solid.size
    m = (side.normal - n * side.cosine) * (1.0 / side.sine)
    e = n.cross(m)
    start = corner - n * face.size - m * side.beyond
    start = start - e * e.dot(start)
    here, there = [], []
    for other in solid.faces:
        beyond, rate = other.n.dot(start) - (other.d + TOLERANCE), other.n.dot(e) * size
        here.append(beyond - rate)
        there.append(beyond + rate)
    begin, end, is_there = clipped(here, there)
    middle, half = start + e * (size * (begin + end - 1.0)), e * (size * (end - begin))
    course = Course.of(roller, middle, half)
    t, depth = course.inside(roller.radius, roller.half)
    most = minimum(roller.radius, roller.half)
    less = minimum(maximum(_SMALLER * depth, _ROUND * most), _MOST * most)
    core = replace(roller, radius=roller.radius - less, half=roller.half - less)
    point = middle + half * course.nearest(core.radius, core.half, t)
    _, inward = distance(core, point)
    low = least([inward.dot(vertex) for vertex in solid.vertices])
    apart = low - inward.dot(roller.center) - reach(roller, inward)
    return Axis(where(is_there, apart, -FAR), -inward), point
