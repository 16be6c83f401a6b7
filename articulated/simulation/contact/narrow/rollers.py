"""Cylinders against balls, capsules and boxes (for each other see `axles`).

Of a capsule three balls are: where its line is nearest to the cylinder, and where the part of it begins and ends that lies
along the cylinder's side or across its end, so that a capsule rests on two points. A box is a polyhedron with eight corners; a
cylinder on it rolls or stands as on any other (see `rims` and `footprints`).
"""

from __future__ import annotations

from articulated.scalar import absolute, either, maximum, minimum, where
from articulated.simulation.contact.narrow.axles import roller_roller
from articulated.simulation.contact.narrow.cylinders import Course, ball
from articulated.simulation.contact.narrow.footprints import roller_solid
from articulated.simulation.contact.narrow.lines import clamped
from articulated.simulation.contact.narrow.placed import FAR, Block, Rod, Roller, Touch

__all__ = ["rod_roller", "roller_block", "roller_roller"]

_ON_END = 0.7
"""Cosine between a cylinder's axis and the normal from which a capsule lies across its end."""


def rod_roller(a: Rod, b: Roller) -> list[Touch]:
    """The points of a rod and a cylinder: one if it is a ball, else three."""
    if a.half is None:
        return [ball(b, a.center, a.radius)]
    course = Course.of(b, a.center, a.half)
    t = course.nearest(b.radius, b.half, course.middle(b.half))
    nearest = ball(b, a.center + a.half * t, a.radius)
    on_end = absolute(nearest.normal.dot(b.axis)) > _ON_END
    begin, end = either(on_end, course.over(b.radius), course.beside(b.half))
    touches, are_two = [nearest], maximum(begin, -1.0) < minimum(end, 1.0)
    for place in (begin, end):
        touch = ball(b, a.center + a.half * clamped(place), a.radius)
        touches.append(Touch(where(are_two, touch.size, FAR), touch.normal, touch.point))
    return touches


def roller_block(a: Roller, b: Block) -> list[Touch]:
    """The points of a cylinder and a box, four of them; those that are not there are far."""
    return roller_solid(a, b)
