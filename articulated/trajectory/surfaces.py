"""Triangles of shapes, to be drawn: with a normal at each corner, smooth where the shape is and sharp at its edges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from articulated.rig.shapes import Box, Capsule, Cylinder, Mesh, Shape, Sphere

AROUND = 32
"""Sides of what is round; its silhouette is then within half a percent of its radius."""

CREASE = math.radians(30.0)
"""An edge of a mesh is sharp where its two triangles differ by more than this."""

_WITH_TEXTURE = ("image", "baseColorTexture")

Color = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles.

    Attributes:
        points: corners, shape (n, 3) [m, or the unit of a mesh file], float32.
        normals: of unit length, outwards, shape (n, 3), float32.
        triangles: numbers of three corners, counterclockwise as seen from outside, shape (m, 3).
        color: RGBA in [0, 1] as its file says, or None.
        textured: whether its file has a picture for it, which is not here.
    """

    points: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    color: Color | None = None
    textured: bool = False


def surface_of(geometry: Sphere | Box | Cylinder | Capsule) -> Surface:
    """The surface of a shape about its origin."""
    if isinstance(geometry, Box):
        return _box(geometry.size)
    if isinstance(geometry, Cylinder):
        r, h = geometry.radius, 0.5 * geometry.length
        below, above = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
        lower, side, upper = [(0.0, -h), (r, -h)], [(r, -h), (r, h)], [(r, h), (0.0, h)]
        normals = [[below] * 2, [(1.0, 0.0, 0.0)] * 2, [above] * 2]
        return _joined([_revolved(profile, normal) for profile, normal in zip([lower, side, upper], normals, strict=True)])
    h = 0.5 * geometry.length if isinstance(geometry, Capsule) else 0.0
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, AROUND // 2 + 1)
    rims = np.column_stack([np.cos(angles), np.sin(angles)])
    rims[[0, -1], 0] = 0.0
    middle = AROUND // 4
    if h > 0.0:
        rims = np.insert(rims, middle, rims[middle], axis=0)
    lift = np.where(np.arange(len(rims)) <= middle, -h, h) if h > 0.0 else np.zeros(len(rims))
    profile = geometry.radius * rims + np.column_stack([np.zeros(len(rims)), lift])
    return _revolved(profile.tolist(), [(r, 0.0, z) for r, z in rims.tolist()])


def can_be_drawn(shape: Shape) -> bool:
    """Whether there are triangles for it: all but a mesh whose file was not found."""
    return not isinstance(shape.geometry, Mesh) or shape.geometry.path is not None


def surfaces_in(path: Path) -> list[Surface]:
    """The parts of a mesh file, with their colours, all together where `read_mesh` has them.

    Raises:
        ValueError: the file is gone, or cannot be read.
    """
    import trimesh

    if not path.is_file():
        raise ValueError(f"{path}: no such file; give the path of a mesh")
    try:
        parts: list[Any] = list(trimesh.load(path, force="scene").dump())  # type: ignore[union-attr]
    except Exception as error:  # readers of many formats fail in many ways
        raise ValueError(f"{path}: this mesh cannot be read ({type(error).__name__}: {error}); convert it to STL") from None
    parts = [part for part in parts if isinstance(part, trimesh.Trimesh)]
    surfaces = [_of_mesh(part, linear=path.suffix.lower() in (".glb", ".gltf")) for part in parts]
    surfaces = [surface for surface in surfaces if len(surface.triangles)]
    if not surfaces:
        raise ValueError(f"{path}: this mesh has no triangles; nothing of it can be drawn")
    return surfaces


def creased(corners: np.ndarray) -> Surface:
    """Triangles, shape (m, 3, 3), whose corners share a normal where their faces meet at less than `CREASE`.

    A normal is the mean over faces by their area. Triangles without area are left out.
    """
    corners = corners[np.isfinite(corners).all(axis=(1, 2))].astype(np.float32).astype(float)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1)
    some = length > 1e-30
    corners, across, flat = corners[some], across[some], across[some] / length[some, None]
    points, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    patch = _patches(faces, flat)
    # one corner for each point in each patch
    pairs = np.column_stack([faces.reshape(-1), np.repeat(patch, 3)])
    kept, first, triangles = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    normals = np.zeros((len(kept), 3))
    np.add.at(normals, triangles.reshape(-1), np.repeat(across, 3, axis=0))
    length = np.linalg.norm(normals, axis=1)
    lost = length < 1e-3 * np.linalg.norm(across[first // 3], axis=1)  # the two sides of a sheet
    normals[lost], length[lost] = flat[first[lost] // 3], 1.0
    return Surface(points[kept[:, 0]].astype(np.float32), (normals / length[:, None]).astype(np.float32), triangles)


def _patches(faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """For each face the number of the smooth patch that it is part of, shape (m,)."""
    m = len(faces)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(m), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    same = np.all(edges[1:] == edges[:-1], axis=1)
    a, b = owner[:-1][same], owner[1:][same]
    smooth = np.sum(normals[a] * normals[b], axis=1) > math.cos(CREASE)
    a, b = a[smooth], b[smooth]
    return connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(m, m)), directed=False)[1]


def _of_mesh(mesh: Any, linear: bool) -> Surface:
    surface = creased(mesh.triangles)
    material = getattr(mesh.visual, "material", None)
    color = None if material is None else tuple(np.asarray(material.main_color, dtype=float) / 255.0)
    if color is not None and linear:
        color = (*(_encoded(x) for x in color[:3]), color[3])
    textured = any(getattr(material, name, None) is not None for name in _WITH_TEXTURE)
    return Surface(surface.points, surface.normals, surface.triangles, color, textured)  # type: ignore[arg-type]


def _encoded(x: float) -> float:
    """sRGB of linear light, IEC 61966-2-1."""
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1.0 / 2.4) - 0.055


def _box(size: tuple[float, float, float]) -> Surface:
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal, u, v = np.roll(np.eye(3), axis, axis=1)
            square = np.array([sign * normal - sign * u - v, sign * normal + sign * u - v])
            square = np.vstack([square, square[::-1] + 2.0 * v])
            points = 0.5 * np.array(size) * square
            faces.append(_surface(points, np.tile(sign * normal, (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])))
    return _joined(faces)


def _revolved(profile: list[Any], normals: list[Any]) -> Surface:
    """A curve from below to above, (r, z), turned about z; normals (r, 0, z) are of unit length."""
    rows, angle = len(profile), 2.0 * math.pi * np.arange(AROUND) / AROUND
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    r, z = np.array(profile).T
    n = np.array(normals)
    points = np.concatenate([r[:, None, None] * turn, np.broadcast_to(z[:, None, None], (rows, AROUND, 1))], axis=-1)
    outwards = np.concatenate([n[:, :1, None] * turn, np.broadcast_to(n[:, 2:, None], (rows, AROUND, 1))], axis=-1)
    here = np.arange(AROUND)
    there = (here + 1) % AROUND
    triangles = []
    for i in range(rows - 1):
        low, high = i * AROUND, (i + 1) * AROUND
        if r[i] > 0.0:
            triangles.append(np.column_stack([low + here, low + there, high + there]))
        if r[i + 1] > 0.0:
            triangles.append(np.column_stack([low + here, high + there, high + here]))
    return _surface(points.reshape(-1, 3), outwards.reshape(-1, 3), np.vstack(triangles or [np.zeros((0, 3), int)]))


def _joined(parts: list[Surface]) -> Surface:
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    triangles = np.vstack([part.triangles + start for part, start in zip(parts, starts, strict=False)])
    return _surface(np.vstack([part.points for part in parts]), np.vstack([part.normals for part in parts]), triangles)


def _surface(points: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> Surface:
    return Surface(points.astype(np.float32), normals.astype(np.float32), triangles)
