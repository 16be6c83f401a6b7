"""The faces of polyhedra that look at each other along a normal, and where they overlap.

Seen along the normal both faces are convex polygons in one plane, and above each point of the plane each has a height. A gap
is the difference of two heights, whether the faces are parallel or not, and whether bodies are apart or in each other. The
corners of the overlap are ends of one polygon's sides, clipped to the other (Cyrus and Beck, Generalized Two- and
Three-Dimensional Clipping, 1978), and the other's corners within the first. Differs from clipping in space: how deep the
bodies are does not matter.

symbol   meaning
u, v     coordinates along the plane [m]
D        how far a point is to the right of a side, times the side's length [m²]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, absolute, either, greatest, maximum, minimum, where
from articulated.simulation.contact.narrow.reduction import Across, Place
from articulated.simulation.contact.narrow.solids import Solid
from articulated.spatial import Vec3

TOLERANCE = 1e-6
"""By how much a polygon is larger than it is, so that corners and sides that lie on each other are found [m]."""
_LEVEL = 1e-3
"""Corners lower by this part of the body's size count half as much as the highest when a face is chosen."""
_FLAT = 0.5
"""What a face that looks along the normal has over one that stands along it; a corner counts 1."""
_STEEPEST = 1e-2
"""Cosine between the normal and that of a face from which on it is no ground to stand on."""
_SLIGHT = 1e-24
_FARTHEST = 1e3


@dataclass(frozen=True, eq=False)
class Facet:
    """A face across a normal: its corners, counterclockwise seen against the normal, and its plane.

    Attributes:
        ring: coordinates u and v of the corners [m].
        level, slopes: the plane's height is level + slopes · (u, v) [m].
    """

    ring: list[tuple[Scalar, Scalar]]
    level: Scalar
    slopes: tuple[Scalar, Scalar]

    def height(self, u: Scalar, v: Scalar) -> Scalar:
        """Of its plane."""
        return self.level + self.slopes[0] * u + self.slopes[1] * v

    def sides(self) -> list[Side]:
        """Of its polygon."""
        return [Side.of(a, b) for a, b in zip(self.ring, [*self.ring[1:], self.ring[0]], strict=True)]


@dataclass(frozen=True, eq=False)
class Side:
    """Of a polygon: D = u along_v − v along_u − offset."""

    along_u: Scalar
    along_v: Scalar
    offset: Scalar

    @staticmethod
    def of(a: tuple[Scalar, Scalar], b: tuple[Scalar, Scalar]) -> Side:
        """From one corner to the next, moved out by the tolerance."""
        along_u, along_v = b[0] - a[0], b[1] - a[1]
        outward = TOLERANCE * (absolute(along_u) + absolute(along_v) + TOLERANCE)  # positive for a side without length too
        return Side(along_u, along_v, a[0] * along_v - a[1] * along_u + outward)

    def beyond(self, u: Scalar, v: Scalar) -> Scalar:
        """D of a point: positive outside."""
        return u * self.along_v - v * self.along_u - self.offset


def facet(solid: Solid, axes: Across, shift: Vec3, side: float) -> Facet:
    """The face of a polyhedron that looks along a normal (side 1), or against it (−1), and reaches farthest that way.

    Of an edge or a corner in front, many faces are part: it is the flattest of those that have most of it.

    Args:
        solid: in its own axes.
        axes: across the normal, given in these.
        shift: where its own axes start, in axes across the normal.
        side: 1 or −1.
    """
    heights = [side * (shift.z + axes.n.dot(vertex)) for vertex in solid.vertices]
    highest = greatest(heights)
    scale = _LEVEL * solid.size
    weights = [scale / (scale + highest - height) for height in heights]
    best, most = None, -1.0
    for face in solid.faces:
        cosine = side * axes.n.dot(face.n)
        held = (holds * weight for holds, weight in zip(face.holds, weights, strict=True))
        value = where(cosine > _STEEPEST, sum(held, _FLAT * cosine), -1.0)
        parts = face.n, face.d, face.ring
        best, most = (parts, value) if best is None else either(value > most, (parts, value), (best, most))
    assert best is not None
    n, offset, corners = best
    ring = [(shift.x + axes.u.dot(corner), shift.y + axes.v.dot(corner)) for corner in corners]
    plane = axes.of_vector(n)
    steep = side / maximum(side * plane.z, 0.1 * _STEEPEST)
    slopes = (-(plane.x * steep), -(plane.y * steep))
    level = shift.z + offset * steep - (slopes[0] * shift.x + slopes[1] * shift.y)
    return Facet(ring if side > 0.0 else ring[::-1], level, slopes)


def reach_above(solid: Solid, axes: Across, shift: Vec3, u: Scalar, v: Scalar, side: float) -> Scalar:
    """The height at which a line along the normal leaves a polyhedron, upwards (side 1) or downwards (−1); as for `facet`."""
    highest = _FARTHEST
    for face in solid.faces:
        m = axes.of_vector(face.n)
        cosine, rest = side * m.z, face.d - (m.x * (u - shift.x) + m.y * (v - shift.y))
        highest = minimum(highest, where(cosine > _STEEPEST, rest / maximum(cosine, _STEEPEST), _FARTHEST))
    return shift.z + side * highest


def overlap(upper: Facet, lower: Facet) -> list[Place]:
    """The corners that two polygons have in common may have, with gaps; heights are left at zero."""

    def place(u: Scalar, v: Scalar, there: Scalar) -> Place:
        return Place(upper.height(u, v) - lower.height(u, v), Vec3(u, v, 0.0)).only(there)

    sides, places = lower.sides(), []
    D = [[side.beyond(u, v) for side in sides] for u, v in upper.ring]
    for i, (u, v) in enumerate(upper.ring):
        j = (i + 1) % len(upper.ring)
        begin, end, is_there = clipped(D[i], D[j])
        along_u, along_v = upper.ring[j][0] - u, upper.ring[j][1] - v
        places += [place(u + along_u * t, v + along_v * t, is_there) for t in (begin, end)]
    sides = upper.sides()
    for u, v in lower.ring:
        places.append(place(u, v, greatest([side.beyond(u, v) for side in sides]) <= 0.0))
    return places


def line_over(face: Facet, x: Vec3, y: Vec3) -> list[Place]:
    """The ends of a line from x to y, clipped to a face below it."""
    sides, places = face.sides(), []
    begin, end, is_there = clipped([side.beyond(x.x, x.y) for side in sides], [side.beyond(y.x, y.y) for side in sides])
    for t in (begin, end):
        p = x + (y - x) * t
        size = p.z - face.height(p.x, p.y)
        places.append(Place(size, Vec3(p.x, p.y, p.z - 0.5 * size)).only(is_there))
    return places


def clipped(here: Sequence[Scalar], there: Sequence[Scalar]) -> tuple[Scalar, Scalar, Scalar]:
    """Where a line from one point (0) to another (1) begins and ends to be inside, and whether it ever is.

    Args:
        here, there: how far each of the points is outside each border, in any unit.
    """
    begin, end = 0.0, 1.0
    for x, y in zip(here, there, strict=True):
        fall = x - y
        enters = fall > 0.0
        t = x / (fall + where(enters, _SLIGHT, -_SLIGHT))
        begin, end = maximum(begin, where(enters, t, 0.0)), minimum(end, where(enters, 1.0, t))
    return minimum(begin, 1.0), maximum(end, 0.0), begin <= end
