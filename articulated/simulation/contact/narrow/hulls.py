"""Polyhedra against all other shapes.

Two of them touch along the normal that `arcs` and `crossings` find, in up to four points of the overlap of the faces that look
at each other along it (see `facets`); a box is a polyhedron too. If that normal is not the best, one may be below all of the
other where they are told to be deep in each other: that is looked at. A ball is as far away as from the best face, or if it is
not over that, from the nearest edge. So is a capsule, which rests on the ends of what of it is over the face. Of cylinders see
`rims`.

symbol   meaning
c, d     middle and half of a rod's line, in the polyhedron's axes
"""

from __future__ import annotations

from articulated.scalar import Scalar, either, given, least, maximum, minimum, sqrt, where
from articulated.simulation.contact.narrow.arcs import Axis, best_axis, best_face
from articulated.simulation.contact.narrow.crossings import turned
from articulated.simulation.contact.narrow.facets import facet, line_over, overlap, reach_above
from articulated.simulation.contact.narrow.footprints import roller_solid
from articulated.simulation.contact.narrow.lines import clamped, nearest
from articulated.simulation.contact.narrow.placed import FAR, Block, Hull, Rod, Roller, Touch
from articulated.simulation.contact.narrow.reduction import LOWER, Across, Place, four
from articulated.simulation.contact.narrow.solids import Solid
from articulated.spatial import Mat3, Vec3

_PREFERENCE = 1e-9
"""How much farther apart they must be along an axis that belongs to the first for it to take the place of the second's [m]."""
_DEEP = 0.02
"""A depth that might be none: as a part of the sizes of both."""
_STEPS = 2
"""How often a normal is turned."""
_TINY = 1e-24


def hull_rod(a: Hull, b: Rod) -> list[Touch]:
    """The points of a polyhedron and a rod: one if it is a ball, else three."""
    solid, c = a.solid, a.R.transpose_times(b.center - a.center)
    d = None if b.half is None else a.R.transpose_times(b.half)
    ends = [c] if d is None else [c - d, c + d]
    axis = best_face(solid, ends)
    edge, point = _of_edge(solid, c, d, ends)
    on_edge = edge.size > axis.size
    axis = either(on_edge, edge, axis)
    size = axis.size - b.radius
    if d is None:
        point = c - axis.normal * (b.radius + 0.5 * size)
        return [Touch(size, -(a.R @ axis.normal), a.center + a.R @ point)]
    across = Across.of(axis.normal)
    face, low = facet(solid, across, Vec3.zero(), 1.0), Vec3(0.0, 0.0, b.radius)
    places = line_over(face, *(across.of_vector(end) - low for end in ends))
    is_lower = size < minimum(places[0].size, places[1].size) - LOWER
    lowest = Place(size, across.of_vector(point + axis.normal * (0.5 * size))).only(on_edge & is_lower)
    world = across.turned(a.R)
    return [Touch(place.size, -world.n, a.center + world.vector(place.point)) for place in (lowest, *places)]


def hull_block(a: Hull, b: Block) -> list[Touch]:
    """The points of a polyhedron and a box, four of them; those that are not there are far."""
    return _solid_solid(a, b)


def hull_roller(a: Hull, b: Roller) -> list[Touch]:
    """The points of a polyhedron and a cylinder, four of them; those that are not there are far."""
    return [Touch(touch.size, -touch.normal, touch.point) for touch in roller_solid(b, a)]


def hull_hull(a: Hull, b: Hull) -> list[Touch]:
    """The points of two polyhedra, four of them; those that are not there are far."""
    return _solid_solid(a, b)


def _solid_solid(a: Hull, b: Hull | Block) -> list[Touch]:
    A, B = a.solid, b.solid
    R, c = b.R.T @ a.R, b.R.transpose_times(a.center - b.center)
    across = Across.of(_normal(A, B, R, c))
    on_a, shift = across.turned(R.T), across.of_vector(c)
    upper, lower = facet(A, on_a, shift, -1.0), facet(B, across, Vec3.zero(), 1.0)
    places = four(overlap(upper, lower))

    deepest = places[0]
    for place in places[1:]:
        deepest = either(place.size < deepest.size, place, deepest)
    u, v, _ = deepest.point

    def common() -> Scalar:
        """Of the line along the normal there: from where it enters b to where it leaves a."""
        return reach_above(A, on_a, shift, u, v, 1.0) - reach_above(B, across, Vec3.zero(), u, v, -1.0)

    between = given(deepest.size < -_DEEP * (A.size + B.size), common, 0.0)
    world, touches = across.turned(b.R), []
    for place in places:
        u, v, _ = place.point
        point = Vec3(u, v, lower.height(u, v) + 0.5 * place.size)
        touches.append(Touch(where(between < 0.0, FAR, place.size), world.n, b.center + world.vector(point)))
    return touches


def _normal(A: Solid, B: Solid, R: Mat3, c: Vec3) -> Vec3:
    """From b to a, in b's axes; R turns a's axes to these, c is where they start."""
    corners, back = [c + R @ x for x in A.vertices], R.transpose_times(c)
    of_b, beyond_b = best_axis(B, corners)
    of_a, beyond_a = best_axis(A, [R.transpose_times(x) - back for x in B.vertices])
    is_of_a = of_a.size > of_b.size + _PREFERENCE
    n = either(is_of_a, -(R @ of_a.normal), of_b.normal)
    # over a face there is none better
    return given(where(is_of_a, beyond_a, beyond_b) > 0.0, lambda: turned(n, corners, B.vertices, _STEPS), n)


def _of_edge(solid: Solid, c: Vec3, d: Vec3 | None, ends: list[Vec3]) -> tuple[Axis, Vec3]:
    """Away from the edge that is nearest to a line, and the point of it."""
    first, *others = solid.edges
    x, y = _nearest(c, d, *first)
    square = (x - y).dot(x - y)
    for edge in others:
        p, q = _nearest(c, d, *edge)
        other = (p - q).dot(p - q)
        x, y, square = either(other < square, (p, q, other), (x, y, square))
    n = (x - y) * (1.0 / sqrt(maximum(square, _TINY)))
    size = least([n.dot(end) for end in ends]) + least([-n.dot(vertex) for vertex in solid.vertices])
    return Axis(where(square > _TINY, size, -FAR), n), y


def _nearest(c: Vec3, d: Vec3 | None, p: Vec3, q: Vec3) -> tuple[Vec3, Vec3]:
    """Where a line, from c − d to c + d, and an edge from p to q are nearest to each other."""
    m, e = (p + q) * 0.5, (q - p) * 0.5
    r, ee = c - m, e.dot(e)
    if d is None:
        return c, m + e * clamped(e.dot(r) * (1.0 / ee))
    s, t = nearest(d.dot(d), ee, d.dot(e), d.dot(r), e.dot(r))
    return c + d * s, m + e * t
