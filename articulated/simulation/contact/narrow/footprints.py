"""Where a cylinder stands on a polyhedron: along a normal, its lowest line and its lower end against the face below.

A cylinder that lies touches with the ends of the line along its side that is lowest: so a wheel rolls smoothly. Where that
reaches beyond the face, it is clipped (Cyrus and Beck, 1978). One that stands touches with four fixed points of its rim: the
ends of two lines across, clipped as well, so that it stands on what is left of the face beyond an edge. The face's sides are
clipped to its end in turn. All is in axes across the normal: a point of it is (along u, along v, height).

symbol   meaning
c, a     the cylinder's middle and axis
e        the point of its end that is lowest, from the end's middle
"""

from __future__ import annotations

import math

from articulated.scalar import absolute, given, maximum, minimum, sqrt, where
from articulated.simulation.contact.narrow.facets import Facet, facet, line_over
from articulated.simulation.contact.narrow.placed import FAR, UPRIGHT, Block, Hull, Roller, Touch
from articulated.simulation.contact.narrow.reduction import ASKEW, LOWER, Across, Place, four
from articulated.simulation.contact.narrow.rims import meeting_of
from articulated.spatial import Vec3

TILTED = 0.2
"""That from which its end is looked at."""
_TINY = 1e-18
_TO_UNIT = 1.0 / math.hypot(1.0, ASKEW)


def roller_solid(a: Roller, b: Hull | Block) -> list[Touch]:
    """The points of a cylinder and a polyhedron, four of them; those that are not there are far."""
    center, R, solid = b.center, b.R, b.solid
    roller = Roller(R.transpose_times(a.center - center), R.transpose_times(a.axis), a.radius, a.half)
    meeting = meeting_of(roller, solid)
    across, size = Across.of(meeting.axis.normal), meeting.axis.size
    footprint = _Footprint(roller, across, facet(solid, across, Vec3.zero(), 1.0))
    places = footprint.line()
    edge = across.of_vector(meeting.point)
    is_lower = size < minimum(places[0].size, places[1].size) - LOWER
    places.append(Place(size, Vec3(edge.x, edge.y, edge.z + 0.5 * size)).only(meeting.on_edge & is_lower))
    lying = [*places, places[0].only(False)]
    is_tilted = absolute(footprint.a.z) > TILTED
    places = given(is_tilted, lambda: four([*places, *footprint.standing()]), lying)
    world = across.turned(R)
    return [Touch(place.size, world.n, center + world.vector(place.point)) for place in places]


class _Footprint:
    """A cylinder over a face.

    Attributes:
        c, a: see above.
        radius, half: its own.
        end: middle of its lower end.
        face: below.
    """

    def __init__(self, roller: Roller, across: Across, face: Facet):
        self.c, self.a = across.of_vector(roller.center), across.of_vector(roller.axis)
        self.radius, self.half, self.face = roller.radius, roller.half, face
        self.end = self.c - self.a * where(self.a.z < 0.0, -self.half, self.half)

    def line(self) -> list[Place]:
        """Of the lowest line along its side."""
        a = self.a
        square = a.x * a.x + a.y * a.y  # not 1 − a.z²: that is nothing but rounding if it stands
        e = Vec3(-(a.z * a.x), -(a.z * a.y), square) * (-self.radius / sqrt(maximum(square, _TINY)))
        return line_over(self.face, self.c + e - a * self.half, self.c + e + a * self.half)

    def standing(self) -> list[Place]:
        """Of its lower end."""
        nowhere = [Place(FAR, self.end)] * 4
        return given(absolute(self.a.z) > UPRIGHT, self._lines_across, nowhere) + self._sides()

    def _lines_across(self) -> list[Place]:
        """Of two lines across the lower end, along the directions that `four` looks in as nearly as can be."""
        a = self.a
        x = Vec3(1.0 - a.x * a.x, -(a.x * a.y), -(a.x * a.z))
        x = x * (self.radius / sqrt(maximum(x.x, _TINY)))  # x · x is x.x
        y = a.cross(x) * where(a.z < 0.0, -1.0, 1.0) + x * ASKEW
        return [place for z in (x, y * _TO_UNIT) for place in line_over(self.face, self.end - z, self.end + z)]

    def _sides(self) -> list[Place]:
        """The ends of the face's sides that are clipped to the cylinder's lower end above them."""
        a, end, face = self.a, self.end, self.face
        rate = 1.0 / where(absolute(a.z) > TILTED, a.z, 1.0)
        corners = [(u - end.x, v - end.y) for u, v in face.ring]
        points = [Vec3(x, y, -((x * a.x + y * a.y) * rate)) for x, y in corners]
        found = []
        for p, q in zip(points, [*points[1:], points[0]], strict=True):
            d = q - p
            dd, pd = maximum(d.dot(d), _TINY), p.dot(d)
            square = pd * pd - dd * (p.dot(p) - self.radius * self.radius)
            root = sqrt(maximum(square, 0.0))
            begin, finish = maximum((-pd - root) / dd, 0.0), minimum((-pd + root) / dd, 1.0)
            for t in (minimum(begin, 1.0), maximum(finish, 0.0)):
                x = end + p + d * t
                size = x.z - face.height(x.x, x.y)
                found.append(Place(size, Vec3(x.x, x.y, x.z - 0.5 * size)).only((square > 0.0) & (begin <= finish)))
        return found
