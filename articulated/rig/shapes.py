"""Shapes of links, for contact and for looks, with where they stand on their link."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
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

PLAIN_SHAPES = {"sphere": Sphere, "box": Box, "cylinder": Cylinder, "capsule": Capsule}
"""The shapes that need no file, by their name in a URDF."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometry on a link.

    Attributes:
        geometry: what it is.
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


def shape_of(geometry: Shape | Geometry | str | os.PathLike[str]) -> Shape:
    """A shape as it is; of a geometry, or of the mesh in a file, one that stands at the origin.

    Raises:
        ValueError: it is none of these, or there is no such file.
    """
    if isinstance(geometry, Shape):
        return geometry
    if isinstance(geometry, Geometry):
        return Shape(geometry)
    if isinstance(geometry, (str, os.PathLike)):
        path = Path(os.path.abspath(os.fspath(geometry)))  # a rig may be written, and read elsewhere
        if not path.is_file():
            raise ValueError(f"{path}: no such file; give the path of a mesh")
        return Shape(Mesh(str(path), path=path))
    raise ValueError(
        f"a geometry is {geometry!r}; expected a Sphere, Box, Cylinder, Capsule or Mesh, a Shape, or the path of a mesh"
    )


def dimensions(geometry: Geometry) -> tuple[float, ...]:
    """The lengths that define a shape [m] (for a mesh, its scale)."""
    if isinstance(geometry, Sphere):
        return (geometry.radius,)
    if isinstance(geometry, Box):
        return geometry.size
    if isinstance(geometry, Mesh):
        return geometry.scale
    return (geometry.radius, geometry.length)
