"""Convex shapes where they stand, in world axes about one common origin, and what is found where two of them meet."""

from __future__ import annotations

from dataclasses import dataclass

from articulated.scalar import Scalar
from articulated.simulation.contact.narrow.solids import Solid
from articulated.spatial import Mat3, Vec3

FAR = 1e3
"""Gap of a point that is not there [m]: how many points a pair has is fixed, whether they are there is not."""


@dataclass(frozen=True, eq=False)
class Touch:
    """A point where two shapes touch, or nearly do.

    Attributes:
        size: gap along the normal, negative where they overlap [m].
        normal: unit vector from the second shape to the first.
        point: halfway between the two surfaces.
    """

    size: Scalar
    normal: Vec3
    point: Vec3


@dataclass(frozen=True, eq=False)
class Rod:
    """All points nearer than the radius to a line between two ends: a capsule; if the ends are one, a ball.

    Attributes:
        center: its middle.
        half: from there to one of its ends; None for a ball.
        radius: [m].
    """

    center: Vec3
    half: Vec3 | None
    radius: float


@dataclass(frozen=True, eq=False)
class Block:
    """A box.

    Attributes:
        center: its middle.
        R: its axes are the columns.
        half: half its lengths [m].
    """

    center: Vec3
    R: Mat3
    half: tuple[float, float, float]

    @property
    def solid(self) -> Solid:
        """The polyhedron that it is."""
        return Solid.of_box(self.half)


@dataclass(frozen=True, eq=False)
class Roller:
    """A cylinder with flat ends.

    Attributes:
        center: its middle.
        axis: unit vector along it.
        radius, half: and half its length [m].
    """

    center: Vec3
    axis: Vec3
    radius: float
    half: float


@dataclass(frozen=True, eq=False)
class Hull:
    """A polyhedron where it stands.

    Attributes:
        center: of its own axes.
        R: these are the columns.
        solid: what it is.
    """

    center: Vec3
    R: Mat3
    solid: Solid


UPRIGHT = 0.9
"""Cosine between a cylinder's axis and the normal from which it counts as standing."""

Placed = Rod | Block | Roller | Hull
