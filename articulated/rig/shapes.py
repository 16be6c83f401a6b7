"""Shapes of links, for contact and for looks, with where they stand on their link."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Sphere:
    """A ball about the origin."""

    radius: float


@dataclass(frozen=True)
class Box:
    """A box about the origin; `size` is its full length along x, y and z [m]."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about the origin along z; `length` is its full height [m]."""

    radius: float
    length: float


@dataclass(frozen=True)
class Capsule:
    """A cylinder about the origin along z with a half ball on each end; `length` is without the half balls [m]."""

    radius: float
    length: float


@dataclass(frozen=True)
class Mesh:
    """A mesh file, as the source names it and where it was found (None: it was not)."""

    filename: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    path: Path | None = None


Geometry = Sphere | Box | Cylinder | Capsule | Mesh
"""What a link can have."""

PLAIN_SHAPES = {"sphere": Sphere, "box": Box, "cylinder": Cylinder, "capsule": Capsule}
"""The shapes that need no file, by their name in a URDF."""


@dataclass(frozen=True)
class Cone:
    """A cone about z. Its origin is halfway up, as a cylinder's: the base lies at -length/2, the apex at +length/2 [m].

    Its centre of mass is therefore not the origin but at z = -length/4.
    """

    radius: float
    length: float


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about the origin; `radii` are its semi-axes along x, y and z [m]."""

    radii: tuple[float, float, float]


@dataclass(frozen=True)
class Hollow:
    """A shape with nothing in it.

        barrel = art.mass_properties(art.Hollow(art.Cylinder(0.3, 0.9), wall=0.002), density=7850.0)
        football = art.mass_properties(art.Hollow(art.Sphere(0.11)), mass=0.43)

    Attributes:
        geometry: its outer surface: a Sphere, Box, Cylinder, Capsule, Cone or Ellipsoid.
        wall: thickness [m], inwards. The inner surface lies at this distance from the outer one, so that ends, base and faces
            have it too. Of an Ellipsoid it is the ellipsoid whose semi-axes are shorter by `wall`: a little nearer than that
            between the axes. None is a shell infinitely thin, of as many kilograms a square metre everywhere: it can be given a
            mass, but no density.
    """

    geometry: Sphere | Box | Cylinder | Capsule | Cone | Ellipsoid
    wall: float | None = None


Solid = Cone | Ellipsoid | Hollow
"""What can only be weighed: neither URDF nor contact knows these."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometry on a link.

    Attributes:
        geometry: what it is. To be weighed by `mass_properties`, not on a link, it may be any `Solid` too.
        pose: its frame in the link's, shape (4, 4).
        name: its name in the source, or "".
        color: RGBA in [0, 1], or None.
    """

    geometry: Geometry
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    name: str = ""
    color: tuple[float, float, float, float] | None = None


def parts_of(given: Any) -> list[Any]:
    """What was given, be it one thing or a sequence of them.

    Raises:
        ValueError: it is an empty sequence.
    """
    if not isinstance(given, Sequence) or isinstance(given, str):
        return [given]
    if not given:
        raise ValueError("an empty sequence of shapes was given; expected one shape at least")
    return list(given)


def shape_of(geometry: Shape | Geometry | Solid | str | os.PathLike[str]) -> Shape:
    """A shape as it is; of a geometry, or of the mesh in a file, one that stands at the origin.

    Raises:
        ValueError: it is none of these, or there is no such file.
    """
    if isinstance(geometry, Shape):
        return geometry
    if isinstance(geometry, Geometry | Solid):
        return Shape(geometry)  # type: ignore[arg-type]
    if isinstance(geometry, (str, os.PathLike)):
        path = Path(os.path.abspath(os.fspath(geometry)))  # a rig may be written, and read elsewhere
        if not path.is_file():
            raise ValueError(f"{path}: no such file; give the path of a mesh")
        return Shape(Mesh(str(path), path=path))
    raise ValueError(
        f"a geometry is {geometry!r}; expected a Sphere, Box, Cylinder, Capsule or Mesh, a Shape, or the path of a mesh"
    )


def dimensions(geometry: Geometry | Cone | Ellipsoid) -> tuple[float, ...]:
    """The lengths that define a shape [m] (for a mesh, its scale)."""
    if isinstance(geometry, Sphere):
        return (geometry.radius,)
    if isinstance(geometry, Box):
        return geometry.size
    if isinstance(geometry, Mesh):
        return geometry.scale
    if isinstance(geometry, Ellipsoid):
        return geometry.radii
    return (geometry.radius, geometry.length)


def thickest_wall(geometry: Sphere | Box | Cylinder | Capsule | Cone | Ellipsoid) -> float:
    """The wall with which a hollow shape would be solid [m]."""
    if isinstance(geometry, Box):
        return 0.5 * min(geometry.size)
    if isinstance(geometry, Ellipsoid):
        return min(geometry.radii)
    if isinstance(geometry, Cylinder):
        return min(geometry.radius, 0.5 * geometry.length)
    if isinstance(geometry, Cone):
        return inscribed_radius(geometry)
    return geometry.radius


def inscribed_radius(cone: Cone) -> float:
    """Of the largest ball in a cone [m]; its centre is so far above the base."""
    return cone.radius * cone.length / (cone.radius + hypot(cone.radius, cone.length))
