"""The normal along which two polyhedra are farthest apart, or least deep in each other: of faces, edges and corners.

All axes that can separate polyhedra are those of faces and of pairs of edges (Gottschalk, Lin and Manocha, OBBTree, 1996), and
of pairs there are too many to try. Differs: they are sought from faces. From the face of one body that is farthest from the
other the normal is turned about a side of the face, one beyond which the other's lowest corner lies, until a second corner is
as low: now the side and the edge between these corners look at each other. This is done from both bodies. All the while the
side is what is highest of one body, and all corners of the other are looked at: so they are at least as far apart as is told.
In a few of a hundred poses they are farther apart along another axis, of which `crossings` takes care.

symbol   meaning
n, s     unit normal of the face; how far the other body is from it [m]
m, λ     unit vector along the face and square to a side, outward; how far the lowest corner is beyond that side [m]
h, w     of the other's corners: how much higher they are than the lowest, and how much less far out along m [m]
r        cotangent of the angle by which the normal turns: n r + m is along the new one
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, either, given, least, maximum, sqrt, where
from articulated.simulation.contact.narrow.solids import Solid
from articulated.spatial import Vec3

_PARALLEL = 1e-6
"""Square of the sine of the angle below which two faces have no side in common."""
_SLIGHT = 1e-12
_LEAST = 1e-6
_NONE = -1e3


@dataclass(frozen=True, eq=False)
class Axis:
    """A direction, and how far apart bodies are along it.

    Attributes:
        size: negative where they overlap [m].
        normal: unit vector, outward.
    """

    size: Scalar
    normal: Vec3


@dataclass(frozen=True, eq=False)
class Side:
    """Of the best face.

    Attributes:
        beyond: λ.
        cosine, sine: of the angle between the two faces.
        normal: of the face behind it.
    """

    beyond: Scalar
    cosine: Scalar
    sine: Scalar
    normal: Vec3


def best_face(solid: Solid, points: Sequence[Vec3]) -> Axis:
    """The face of a polyhedron from which points are farthest; they are given in its own axes."""
    return best_of([Axis(least([face.n.dot(x) for x in points]) - face.d, face.n) for face in solid.faces])


def best_of(axes: Sequence[Axis]) -> Axis:
    """That along which bodies are farthest apart, the first of equals."""
    best = axes[0]
    for axis in axes[1:]:
        best = either(axis.size > best.size, axis, best)
    return best


def best_axis(solid: Solid, points: Sequence[Vec3]) -> tuple[Axis, Scalar]:
    """The face of a polyhedron, or the turn from it about one of its sides, along which points are farthest.

    Returns:
        It, and how far the lowest point is beyond the face's farthest side [m].
    """
    face = best_face(solid, points)
    heights = [face.normal.dot(x) for x in points]
    corner, low = points[0], heights[0]
    for x, height in zip(points[1:], heights[1:], strict=True):
        corner, low = either(height < low, (x, height), (corner, low))
    heights = [height - low for height in heights]
    side = farthest(sides(solid, face, corner))
    turned = given(side.beyond > 0.0, lambda: _turned(face, side, corner, points, heights), Axis(_NONE, face.normal))
    return either(turned.size > face.size, turned, face), side.beyond


def sides(solid: Solid, face: Axis, corner: Vec3) -> list[Side]:
    """The sides of a face's plane, if all others cut it; of parallel ones there is none."""
    found = []
    for other in solid.faces:
        cosine = face.normal.dot(other.n)
        square = 1.0 - cosine * cosine
        sine = sqrt(maximum(square, _PARALLEL))
        beyond = (other.n.dot(corner) - other.d - face.size * cosine) / sine  # of the corner's foot in the face's plane
        found.append(Side(where(square > _PARALLEL, beyond, _NONE), cosine, sine, other.n))
    return found


def _turned(face: Axis, side: Side, corner: Vec3, points: Sequence[Vec3], heights: Sequence[Scalar]) -> Axis:
    """The normal turned about a side: until a second corner is as low, or it is the next face's, or points to the lowest."""
    n, cosine, sine = face.normal, side.cosine, side.sine
    m = (side.normal - n * cosine) * (1.0 / sine)
    is_beyond = side.beyond > _SLIGHT
    beyond = where(is_beyond, side.beyond, 1.0)
    r = maximum(maximum(cosine / sine, face.size / beyond), _LEAST)
    reach = m.dot(corner)
    for x, h in zip(points, heights, strict=True):
        r = maximum(r, (reach - m.dot(x)) / (h + _SLIGHT))
    scale = 1.0 / sqrt(1.0 + r * r)
    return Axis(where(is_beyond, (face.size * r + beyond) * scale, _NONE), (n * r + m) * scale)


def farthest(sides: Sequence[Side]) -> Side:
    """The one that the corner is farthest beyond."""
    best = sides[0]
    for side in sides[1:]:
        best = either(side.beyond > best.beyond, side, best)
    return best
