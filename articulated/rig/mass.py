"""Mass, centre of mass and inertia of shapes and meshes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from articulated.rig.description import LARGEST, check_shape
from articulated.rig.errors import Place
from articulated.rig.frames import is_pose
from articulated.rig.mesh import is_mesh, mesh_moments, read_mesh
from articulated.rig.moments import Moments, moments_of, together
from articulated.rig.shapes import Geometry, Mesh, Shape, parts_of, shape_of

if TYPE_CHECKING:
    import trimesh

    Solid = Geometry | Shape | str | os.PathLike[str] | trimesh.Trimesh


@dataclass(frozen=True, eq=False)
class MassProperties:
    """What a rigid solid weighs, and how it resists turning; in the frame of its shape. Arrays are read-only.

    Attributes:
        mass: [kg].
        center: of mass, shape (3,) [m].
        inertia: about that centre, in the axes of the frame, shape (3, 3) [kg m²].
    """

    mass: float
    center: np.ndarray
    inertia: np.ndarray


def mass_properties(geometry: Solid | Sequence[Solid], density: float = 1000.0, *, mass: float | None = None) -> MassProperties:
    """Mass properties of a solid of one density.

        crate = art.mass_properties(art.Box((0.4, 0.4, 0.4)), density=125.0)
        builder.link("crate", crate.mass, crate.center, crate.inertia)

    Plain shapes in closed form, meshes by volume integrals over their triangles. A mesh that is not closed, or is inside out,
    counts as its convex hull, and a `RigWarning` says so.

    Args:
        geometry: a Sphere, Box, Cylinder, Capsule or Mesh, a Shape (in the frame that its pose is given in), the path of a mesh
            file, or a trimesh.Trimesh; or a sequence of these, as one solid: where they overlap, each counts.
        density: [kg/m³].
        mass: of all of it [kg], instead of the density.

    Returns:
        Mass, centre of mass and inertia about it.

    Raises:
        ValueError: a length, the density or the mass is not a positive number, a file is no mesh, or a mesh is flat or empty.
    """
    whole = together([_moments(one) for one in parts_of(geometry)])
    if mass is None:
        _check_positive("density", density, "kilograms a cubic metre")
        mass = density * whole.volume
    else:
        _check_positive("mass", mass, "kilograms")
    return MassProperties(float(mass), _frozen(whole.center), _frozen(mass / whole.volume * whole.inertia))


def _moments(geometry: Any) -> Moments:
    """In the frame in which the pose of a shape is given."""
    if is_mesh(geometry):
        return mesh_moments(geometry, np.ones(3), Place(f"Trimesh of {len(geometry.faces)} triangles"))
    shape = shape_of(geometry)
    what, kind, X = shape.geometry, type(shape.geometry).__name__, np.asarray(shape.pose, dtype=float)
    check_shape(Place("mass_properties"), shape)
    if X.shape != (4, 4) or not is_pose(X):
        raise ValueError(f"pose of a {kind} is not a rotation and a translation; expected shape (4, 4), last row 0 0 0 1")
    if isinstance(what, Mesh):
        if what.path is None:
            raise ValueError(f"mesh {what.filename!r} was not found; give load its mesh_dirs, or the Mesh a path")
        moments = mesh_moments(read_mesh(Path(what.path)), np.array(what.scale, dtype=float), Place(str(what.path)))
    else:
        moments = moments_of(what)
    if moments.volume < LARGEST**-3:
        raise ValueError(f"{what} has no volume; mass properties need a solid: give it lengths of more than zero [m]")
    return moments.mapped(X[:3, :3], X[:3, 3])


def _check_positive(what: str, value: Any, unit: str) -> None:
    if not isinstance(value, (int, float, np.number)) or not 0.0 < value <= LARGEST:  # false for NaN
        raise ValueError(f"{what} is {value!r}; expected a positive number of {unit}")


def _frozen(values: np.ndarray) -> np.ndarray:
    result = np.array(values, dtype=float)
    result.flags.writeable = False
    return result
