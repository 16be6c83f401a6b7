"""From all places where two bodies may touch, four that hold one on the other, and stay the same while it rests.

Of each slot a friction anchor is kept, so a slot should hold one place from step to step. Two are extreme in two opposite
directions across the normal, and two on either side of the line between these; but lower ones come before others, so that a
tilt far below `LEAN` changes nothing, and one far above leaves the lowest place only. The directions follow the axes in which
the normal is given, which are those of one of the bodies. If the lowest of all is none of the four, it takes the place of the
highest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, absolute, either, minimum, sqrt, where
from articulated.simulation.contact.narrow.placed import FAR
from articulated.spatial import Mat3, Vec3

LEAN = 0.1
"""Slope at which a place that is lower counts as much as one that is farther out."""
LOWER = 1e-5
"""By how much a place has to be lower than all four to take the place of one [m]."""
_DEEPER = 0.5
"""And besides, by this part of how deep these are: what rests on four of six corners is as deep at the others, and trembles."""
ASKEW = 0.1
"""By how much the directions on either side of a line are not square to it: a hexagon has two corners that are."""
_SAME = 1e-5
"""Places that are nearer to each other than this are one [m]."""
_FLAT = 1e-3
"""A third adds nothing that is nearer to the line between two than this part of their distance."""
_OBLIQUE = ((0.6230, 0.5399, 0.5660), (0.6210, -0.7770, 0.1030))
"""Unit vectors that lie along no axis, no diagonal and no plane of symmetry; the directions are askew to a box's edges."""
_NEAR = 0.81


@dataclass(frozen=True, eq=False)
class Across:
    """Axes about a unit normal n: u, v and n.

    Vectors in them are (along u, along v, height).
    """

    u: Vec3
    v: Vec3
    n: Vec3

    @staticmethod
    def of(n: Vec3) -> Across:
        """They depend on the normal only, and jump only where it is at one angle to the first oblique vector."""
        first, second = (Vec3(*x) for x in _OBLIQUE)
        cosine = n.dot(first)
        u = n.cross(either(cosine * cosine < _NEAR, first, second))
        u = u * (1.0 / sqrt(u.dot(u)))
        return Across(u, n.cross(u), n)

    def of_vector(self, x: Vec3) -> Vec3:
        """Components of a vector in these axes."""
        return Vec3(self.u.dot(x), self.v.dot(x), self.n.dot(x))

    def vector(self, x: Vec3) -> Vec3:
        """The reverse."""
        return self.u * x.x + self.v * x.y + self.n * x.z

    def turned(self, R: Mat3) -> Across:
        """The same axes, given in others."""
        return Across(R @ self.u, R @ self.v, R @ self.n)


@dataclass(frozen=True, eq=False)
class Place:
    """Where two bodies may touch.

    Attributes:
        size: gap along the normal [m]; `FAR` for one that is not there.
        point: in axes across the normal.
    """

    size: Scalar
    point: Vec3

    def only(self, there: Scalar) -> Place:
        """The same, where a mask holds."""
        return Place(where(there, self.size, FAR), self.point)


def four(places: Sequence[Place]) -> list[Place]:
    """Four of them; those that would be told twice, or add nothing, are far."""
    heights = [place.size * (1.0 / LEAN) for place in places]

    def farthest(u: Scalar, v: Scalar) -> Place:
        values = [u * x.point.x + v * x.point.y - height for x, height in zip(places, heights, strict=True)]
        return _first(places, values)

    one, two = farthest(1.0, 0.0), farthest(-1.0, 0.0)
    along_u, along_v = one.point.x - two.point.x, one.point.y - two.point.y
    square = along_u * along_u + along_v * along_v
    are_two = square > _SAME * _SAME
    length = sqrt(where(are_two, square, 1.0))
    along_u, along_v = where(are_two, along_u / length, 1.0), where(are_two, along_v / length, 0.0)
    flat = _SAME + _FLAT * length
    chosen = [one, two.only(are_two)]
    for side in (1.0, -1.0):
        u, v = -side * along_v, side * along_u
        place = farthest(u + (side * ASKEW) * along_u, v + (side * ASKEW) * along_v)
        beyond = u * (place.point.x - one.point.x) + v * (place.point.y - one.point.y)
        chosen.append(place.only(beyond > flat))
    return _with_lowest(chosen, _first(places, [-place.size for place in places]))


def _with_lowest(chosen: list[Place], lowest: Place) -> list[Place]:
    """The same, with the lowest instead of the highest, if it is lower than all."""
    low, highest, which = chosen[0].size, chosen[0].size, 0.0
    for k, place in enumerate(chosen[1:]):
        higher = place.size > highest
        low = minimum(low, place.size)
        highest, which = either(higher, (place.size, k + 1.0), (highest, which))
    which = where(lowest.size < low - LOWER + _DEEPER * minimum(low, 0.0), which, -1.0)
    return [either(absolute(which - k) < 0.5, lowest, place) for k, place in enumerate(chosen)]


def _first(places: Sequence[Place], values: Sequence[Scalar]) -> Place:
    """The place with the largest value, the first of equals."""
    best, most = places[0], values[0]
    for place, value in zip(places[1:], values[1:], strict=True):
        best, most = either(value > most, (place, value), (best, most))
    return best
