"""Mass, centre of mass and inertia of shapes and meshes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from articulated.rig.description import INERTIA_TOLERANCE, LARGEST, check_lengths, check_shape, violation
from articulated.rig.errors import Place
from articulated.rig.frames import is_pose
from articulated.rig.hollows import wall_moments
from articulated.rig.mesh import REPAIRS, is_mesh, mesh_moments, read_mesh
from articulated.rig.moments import Moments, moments_of, together
from articulated.rig.shapes import Geometry, Hollow, Mesh, Shape, Solid, parts_of, shape_of

if TYPE_CHECKING:
    import trimesh

    Weighable = Geometry | Solid | Shape | str | os.PathLike[str] | trimesh.Trimesh


@dataclass(frozen=True, eq=False)
class MassProperties:
    """What a rigid body weighs, and how it resists turning, in one frame. Arrays are read-only.

        handle = art.mass_properties(art.Cylinder(0.01, 0.3), 700.0)
        hammer = handle + art.mass_properties(art.Box((0.03, 0.1, 0.03)), 7850.0).moved(X)

    Attributes:
        mass: [kg].
        center: of mass, shape (3,) [m].
        inertia: about that centre, in the axes of the frame, shape (3, 3) [kg m²].

    Raises:
        ValueError: a number is not finite, the mass is not positive, or the inertia is one that no body could have: it is not
            symmetric, or its principal moments violate the triangle inequality.
    """

    mass: float
    center: np.ndarray
    inertia: np.ndarray

    def __post_init__(self):
        check_positive("mass", self.mass, "kilograms")
        object.__setattr__(self, "mass", float(self.mass))
        for name, shape in (("center", (3,)), ("inertia", (3, 3))):
            object.__setattr__(self, name, _frozen(name, getattr(self, name), shape))
        if np.abs(self.inertia - self.inertia.T).max() > 1e-9 * np.abs(self.inertia).max():
            raise ValueError("inertia is not symmetric; expected a symmetric matrix, shape (3, 3)")
        if (by := violation(self.inertia, self.mass)) > INERTIA_TOLERANCE:
            raise ValueError(
                f"inertia violates the triangle inequality by {100.0 * by:.3g} %: no body has principal moments "
                f"{np.array2string(self.principal_moments, precision=4)}; is it about the centre of mass?"
            )

    @property
    def principal_moments(self) -> np.ndarray:
        """Of inertia, about the centre of mass, smallest first, shape (3,) [kg m²]; none exceeds the sum of the others."""
        return np.linalg.eigvalsh(self.inertia)

    def about(self, point: ArrayLike) -> np.ndarray:
        """The inertia about another point, in the same axes, by the parallel-axis theorem (RBDA 2.63).

        Args:
            point: in the same frame, shape (3,) [m].

        Returns:
            Shape (3, 3) [kg m²].
        """
        d = self.center - _frozen("point", point, (3,))
        return self.inertia + self.mass * (d @ d * np.eye(3) - np.outer(d, d))

    def moved(self, pose: ArrayLike) -> MassProperties:
        """The same body in another frame, in which `pose` is that of this one, shape (4, 4): as a `Shape` is on its link.

        Raises:
            ValueError: the pose is not a rotation and a translation.
        """
        X = np.asarray(pose, dtype=float)
        if X.shape != (4, 4) or not is_pose(X):
            raise ValueError("pose is not a rotation and a translation; expected shape (4, 4), last row 0 0 0 1")
        R = X[:3, :3]
        return MassProperties(self.mass, R @ self.center + X[:3, 3], _symmetric(R @ self.inertia @ R.T))

    def __add__(self, other: MassProperties) -> MassProperties:
        return MassProperties.combined([self, other])

    @staticmethod
    def combined(parts: Iterable[MassProperties]) -> MassProperties:
        """Of bodies that move as one, all given in one frame.

        Raises:
            ValueError: there are none.
        """
        parts = list(parts)
        if not parts:
            raise ValueError("an empty sequence of mass properties was given; expected one at least")
        mass = sum(part.mass for part in parts)
        center = np.sum([part.mass * part.center for part in parts], axis=0) / mass
        return MassProperties(mass, center, _symmetric(np.sum([part.about(center) for part in parts], axis=0)))


def mass_properties(
    geometry: Weighable | Sequence[Weighable],
    density: float = 1000.0,
    *,
    mass: float | None = None,
    repair_mesh: str | None = "hull",
) -> MassProperties:
    """Mass properties of a solid of one density.

        crate = art.mass_properties(art.Box((0.4, 0.4, 0.4)), density=125.0)
        builder.link("crate", crate.mass, crate.center, crate.inertia)

    Plain shapes and hollow ones in closed form, meshes by the integrals over their tetrahedra (`moments_within`).

    Args:
        geometry: a Sphere, Box, Cylinder, Capsule, Cone, Ellipsoid, Hollow or Mesh, a Shape (in the frame that its pose is
            given in), the path of a mesh file, or a trimesh.Trimesh; or a sequence of these, as one solid: where they overlap,
            each counts.
        density: [kg/m³].
        mass: of all of it [kg], instead of the density.
        repair_mesh: what a mesh counts as that bounds no solid, because it is not closed, not all of its triangles face
            outwards, or its integrals are those of no body. "hull": its convex hull, whatever the fault; "flip": itself with
            every triangle turned round, if it is just inside out; None: nothing. A `RigWarning` names fault and repair.

    Returns:
        Mass, centre of mass and inertia about it.

    Raises:
        ValueError: a length, the density or the mass is not a positive number, a wall is too thick, a thin shell is given a
            density or goes with what is none, a file is no mesh, or a mesh is flat or empty, or has a fault that is not to be
            repaired.
    """
    if repair_mesh not in REPAIRS:
        raise ValueError(f"repair_mesh is {repair_mesh!r}; expected 'hull', 'flip' or None")
    parts = parts_of(geometry)
    shells = [part for part in parts if _is_shell(part)]
    if shells and len(shells) < len(parts):
        raise ValueError(
            "thin shells and solids have no one density; weigh them apart, each with its mass, and add their MassProperties"
        )
    whole = together([_moments(one, repair_mesh) for one in parts])
    if mass is not None:
        check_positive("mass", mass, "kilograms")
    elif shells:
        raise ValueError("an infinitely thin shell has no volume that a density could fill; give mass=, or the Hollow a wall")
    else:
        check_positive("density", density, "kilograms a cubic metre")
        mass = density * whole.volume
    return MassProperties(mass, whole.center, mass / whole.volume * whole.inertia)


def _is_shell(part: Any) -> bool:
    what = part.geometry if isinstance(part, Shape) else part
    return isinstance(what, Hollow) and what.wall is None


def _moments(geometry: Any, repair_mesh: str | None) -> Moments:
    """In the frame in which the pose of a shape is given."""
    if is_mesh(geometry):
        return mesh_moments(geometry, np.ones(3), Place(f"Trimesh of {len(geometry.faces)} triangles"), repair_mesh)
    shape = shape_of(geometry)
    what, kind, X = shape.geometry, type(shape.geometry).__name__, np.asarray(shape.pose, dtype=float)
    (check_lengths if isinstance(what, Solid) else check_shape)(Place("mass_properties"), shape)
    if X.shape != (4, 4) or not is_pose(X):
        raise ValueError(f"pose of a {kind} is not a rotation and a translation; expected shape (4, 4), last row 0 0 0 1")
    if isinstance(what, Mesh):
        if what.path is None:
            raise ValueError(f"mesh {what.filename!r} was not found; give load its mesh_dirs, or the Mesh a path")
        place = Place(str(what.path))
        moments = mesh_moments(read_mesh(Path(what.path)), np.array(what.scale, dtype=float), place, repair_mesh)
    else:
        moments = wall_moments(what) if isinstance(what, Hollow) else moments_of(what)
    if moments.volume < LARGEST**-3:
        raise ValueError(f"{what} has no volume; mass properties need a solid: give it lengths of more than zero [m]")
    return moments.mapped(X[:3, :3], X[:3, 3])


def check_positive(what: str, value: Any, unit: str) -> None:
    """Refuse what is no positive number.

    Raises:
        ValueError: so.
    """
    if not isinstance(value, (int, float, np.number)) or not 0.0 < value <= LARGEST:  # false for NaN
        raise ValueError(f"{what} is {value!r}; expected a positive number of {unit}")


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)


def _frozen(what: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    result = np.array(values, dtype=float)
    if result.shape != shape:
        raise ValueError(f"{what} has shape {result.shape}; expected {shape}")
    if not np.isfinite(result).all():
        raise ValueError(f"{what} is not finite; expected finite numbers, shape {shape}")
    result.flags.writeable = False
    return result
