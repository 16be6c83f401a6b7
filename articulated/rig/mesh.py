"""The solid that a mesh bounds.

A volume integral over a mesh means something only if its surface is closed: as a sum of directed edges, the boundary of
its triangles must vanish. This holds too where more than two triangles meet in an edge, as where two boxes touch.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from articulated.rig.description import FARTHEST, INERTIA_TOLERANCE, violation
from articulated.rig.errors import Place, RigWarning
from articulated.rig.moments import Moments, moments_within
from articulated.rig.shapes import Mesh

if TYPE_CHECKING:
    import trimesh

_FLAT = 1e-6
"""A mesh thinner than this part of its size is flat: so many digits a single-precision file has."""

_SAME = 8
"""Vertices that agree to so many digits of the mesh's size are one."""

REPAIRS = ("hull", "flip", None)
"""What may be made of a mesh that bounds no solid; see `mass_properties`."""

_INSIDE_OUT = "is inside out"

_METRES = (None, "m", "meter", "meters", "metre", "metres")


def is_mesh(given: object) -> bool:
    """Whether something is a mesh in memory; without importing trimesh, which takes a second."""
    known = sys.modules.get("trimesh")
    return known is not None and isinstance(given, known.Trimesh)


def found_mesh(mesh: Mesh, where: str) -> Path | None:
    """The file of a mesh that something touches with; None if there is none, which is warned of."""
    if mesh.path is None:
        text = f"mesh {mesh.filename!r} {where} was not found: it touches nothing; give load its mesh_dirs"
        warnings.warn(text, RigWarning, stacklevel=2)  # once, however many ask
    return mesh.path


def read_mesh(path: Path) -> trimesh.Trimesh:
    """The triangles of a mesh file, all of a scene as one.

    Raises:
        ValueError: there is no such file, or it cannot be read.
    """
    import trimesh

    if not path.is_file():
        raise ValueError(f"{path}: no such file; give the path of a mesh")
    try:
        mesh = trimesh.load(path, force="mesh")
        reason = "" if len(mesh.faces) else "it has no triangles"  # type: ignore[union-attr]
    except Exception as error:  # readers of many formats fail in many ways
        mesh, reason = None, f"{type(error).__name__}: {error}"
    if reason:
        raise ValueError(f"{path}: this mesh cannot be read ({reason}); convert it to STL, OBJ or PLY, or give other shapes")
    return mesh  # type: ignore[return-value]


def mesh_moments(mesh: trimesh.Trimesh, scale: np.ndarray, place: Place, repair: str | None) -> Moments:
    """Of the solid in a mesh, or in what a repair makes of a mesh that bounds none, which is warned of.

    Args:
        mesh: the triangles.
        scale: factors along its axes, shape (3,).
        place: what the mesh is called.
        repair: one of `REPAIRS`.

    Raises:
        ValueError: it is empty or flat, a vertex is not finite, or it has a fault that this repair does not mend.
    """
    triangles = np.asarray(mesh.triangles, dtype=float).reshape(-1, 3, 3)
    if not len(triangles):
        raise ValueError(f"{place.source}: this mesh has no triangles; mass properties need a solid: give a closed mesh")
    if not np.isfinite(triangles).all():
        raise ValueError(f"{place.source}: this mesh has vertices that are not finite; every one must be: correct the file")
    lowest, highest = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    center, size = 0.5 * (lowest + highest), float((highest - lowest).max())
    _check_size(mesh, (highest - lowest) * np.abs(scale), place)
    # about its own centre and in units of its own size, so that nothing depends on where it stands
    triangles = (triangles - center) / (size or 1.0)
    points, corners = np.unique(triangles.reshape(-1, 3).round(_SAME), axis=0, return_inverse=True)
    thickness = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] / len(points) ** 0.5
    if thickness < _FLAT:
        raise ValueError(
            f"{place.source}: this mesh is flat; mass properties need a solid: give a closed mesh, or a thin Box instead"
        )
    faces = corners.reshape(-1, 3)
    if fault := _fault(triangles, faces):
        triangles = _repaired(triangles, points, faces, fault, place, repair)
    return moments_within(triangles).mapped(size * np.eye(3), center).mapped(np.diag(scale), np.zeros(3))


def _repaired(
    triangles: np.ndarray, points: np.ndarray, faces: np.ndarray, fault: str, place: Place, repair: str | None
) -> np.ndarray:
    """Triangles that bound a solid, from such as do not: their corners, seen from outside."""
    import trimesh

    if repair == "hull":
        place.warn(fault, "its convex hull is used for the mass properties: close the mesh, or give plain shapes")
        return trimesh.Trimesh(points, faces, process=False).convex_hull.triangles
    if repair == "flip" and fault == _INSIDE_OUT:
        place.warn(fault, "its triangles are turned round for the mass properties: turn their corners in the file")
        return triangles[:, ::-1]
    remedy = "correct the mesh, or have its convex hull with repair_mesh='hull'"
    if fault == _INSIDE_OUT:
        remedy = "turn it in the file, or with repair_mesh='flip'"
    raise ValueError(f"{place.source}: this mesh {fault}: it bounds no solid; {remedy}")


def _fault(triangles: np.ndarray, faces: np.ndarray) -> str:
    """Why the triangles, whose vertices have the numbers `faces`, bound no solid; or "" if they do."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = edges[edges[:, 0] != edges[:, 1]]
    sense = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    _, edge = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    edge = edge.reshape(-1)
    if np.bincount(edge, weights=sense).any():
        single = np.count_nonzero(np.bincount(edge) % 2)
        return f"is not closed: it has {single} open edges" if single else "has triangles that do not all face outwards"
    volume = np.linalg.det(triangles).sum() / 6.0
    if abs(volume) < _FLAT**2:
        return "encloses no volume"
    if volume < 0.0:
        return _INSIDE_OUT
    moments = moments_within(triangles)
    if violation(moments.inertia, moments.volume) > INERTIA_TOLERANCE:
        return "has moments of inertia that violate the triangle inequality: some of it is inside out"
    return ""


def _check_size(mesh: trimesh.Trimesh, lengths: np.ndarray, place: Place) -> None:
    if mesh.units not in _METRES:
        place.warn(f"says that its unit is {mesh.units}, which is not applied", "give it a scale; units are metres")
    elif lengths.max() > FARTHEST:
        place.warn(f"is {lengths.max():g} m large", "units are metres; were these millimetres? Give it a scale")
