"""Convex polyhedra of few vertices, from points or a mesh: what two hulls touch with. Once, when a scene is built.

A mesh has thousands of vertices, and the work of two hulls grows with their faces. Vertices are chosen one by one, always that
which lies farthest outside the hull of those before it: the outer loop of Quickhull (Barber, Dobkin and Huhdanpaa, 1996),
ended early. Then one of them is exchanged for the farthest that was left out, as long as that brings all others nearer. What
is left out is inside or near, and how near is told. (Vertices far from each other, as those that stand on the ground are
chosen, leave half as much again outside, on meshes of robots.)
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from articulated.rig.mesh import read_mesh
from articulated.simulation.contact.narrow.solids import Polyhedron

MOST_VERTICES = 12
"""Vertices that a hull keeps; so many make 20 faces at most."""

_COPLANAR = 1e-4
"""Triangles are one face if none of their corners is farther from its plane than this part of the hull's size."""
_ALIGNED = 0.999
"""And if the cosine between their normals is no less."""

Point = tuple[float, float, float]


def polyhedron(vertices: Any) -> tuple[Point, Polyhedron]:
    """The convex hull of points.

    Args:
        vertices: shape (n, 3) [m].

    Returns:
        Where its own axes start, the middle of its volume [m], and the hull, in these.

    Raises:
        ValueError: there are fewer than four points, or all in a plane, or some are not finite.
    """
    points = _checked(vertices)
    center = _centroid(points, _hull(points))
    points, size = points - center, float(np.ptp(points, axis=0).max())
    while True:
        triangles = _hull(points)
        group, normals = _faces(points, triangles, _COPLANAR * size)
        around = [set() for _ in points]
        for k, corners in zip(group, triangles, strict=True):
            for i in corners:
                around[i].add(int(k))
        corners = [i for i, faces in enumerate(around) if len(faces) > 2]  # others are on an edge or in a face
        if len(corners) == len(points):
            break
        points = points[corners]
    offsets = (normals @ points.T).max(axis=1)
    faces = tuple((_point(n), float(d)) for n, d in zip(normals, offsets, strict=True))
    return _point(center), Polyhedron(tuple(_point(p) for p in points), faces, _edges(triangles, group))


def polyhedron_of_mesh(
    path: Path, scale: Point = (1.0, 1.0, 1.0), most: int = MOST_VERTICES
) -> tuple[Point, Polyhedron, float]:
    """The convex hull of a mesh, of no more vertices than `most`.

    Returns:
        Where its own axes start in the mesh's [m], the hull, and how far the mesh reaches out of it [m].

    Raises:
        ValueError: the mesh cannot be read, or is flat, or not finite.
    """
    return _of_mesh(path, path.stat().st_mtime_ns, tuple(scale), most)


@lru_cache(maxsize=1024)
def _of_mesh(path: Path, _: int, scale: Point, most: int) -> tuple[Point, Polyhedron, float]:
    chosen, lost = simplified(corners_of_mesh(path, scale), most)
    return *polyhedron(chosen), lost


def corners_of_mesh(path: Path, scale: Point) -> np.ndarray:
    """The vertices of a mesh's convex hull, shape (n, 3) [m].

    Raises:
        ValueError: as of `polyhedron_of_mesh`.
    """
    vertices = np.asarray(read_mesh(path).vertices, dtype=float) * scale
    try:
        return _corners(vertices)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def simplified(vertices: Any, most: int = MOST_VERTICES) -> tuple[np.ndarray, float]:
    """Vertices whose hull comes near to that of all.

    Args:
        vertices: shape (n, 3) [m].
        most: how many to keep, four or more.

    Returns:
        Some of the vertices, shape (m, 3) [m], and the largest distance of another from their hull [m].

    Raises:
        ValueError: as of `polyhedron`; `most` is less than four.
    """
    if most < 4:
        raise ValueError(f"most is {most}; expected 4 or more: a body of fewer vertices is flat")
    points = _corners(vertices)
    if len(points) <= most:
        return points, 0.0
    chosen = _tetrahedron(points)
    while len(chosen) < most:
        chosen.append(int(np.argmax(_beyond(points, points[chosen]))))
    chosen = _exchanged(points, chosen)
    return points[chosen], _shortfall(points, points[chosen])


def _corners(vertices: Any) -> np.ndarray:
    points = _checked(vertices)
    return points[np.unique(_hull(points))]


def _checked(vertices: Any) -> np.ndarray:
    points = np.array(vertices, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise ValueError(f"vertices have shape {points.shape}; expected (n, 3) with n of 4 or more: give it more points")
    if not np.isfinite(points).all():
        bad = points[~np.isfinite(points).all(axis=1)][0]
        raise ValueError(f"a vertex is {tuple(bad.tolist())}; expected finite numbers: repair it, or leave it out")
    return points


def _hull(points: np.ndarray) -> np.ndarray:
    """Triangles of the convex hull, counterclockwise seen from outside, shape (n, 3)."""
    size = np.ptp(points, axis=0).max()
    flat = "vertices lie in a plane, or nearly; expected a body with a volume: give its link a box, or move one of them"
    if size == 0.0 or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < 1e-6 * size:
        raise ValueError(flat)
    try:
        hull = ConvexHull(points)
    except QhullError:
        raise ValueError(flat) from None
    triangles = hull.simplices.copy()
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inward = np.einsum("ni,ni->n", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    return triangles


def _centroid(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Middle of the volume: of tetrahedra over all triangles, with a corner inside."""
    inside = points.mean(axis=0)
    corners = points[triangles] - inside
    volume = np.linalg.det(corners)
    return inside + volume @ corners.sum(axis=1) / (4.0 * volume.sum())


def _faces(points: np.ndarray, triangles: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Which face each triangle is part of, and the faces' normals: large triangles take those in their plane along."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    lengths = np.linalg.norm(areas, axis=1)
    normals = areas / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    group, found = np.full(len(triangles), -1), []
    for k in np.argsort(-lengths):
        if group[k] < 0:
            off = np.abs((points - points[triangles[k, 0]]) @ normals[k])
            near = (off[triangles].max(axis=1) < tolerance) & (
                (normals @ normals[k] > _ALIGNED) | (lengths < tolerance * lengths[k])
            )
            near[k] = True
            group[near & (group < 0)] = len(found)
            total = areas[group == len(found)].sum(axis=0)
            found.append(total / np.linalg.norm(total))
    return group, np.array(found)


def _edges(triangles: np.ndarray, group: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Pairs of vertices that two faces share."""
    sides: dict[tuple[int, int], set[int]] = {}
    for k, corners in zip(group, triangles, strict=True):
        for i, j in zip(corners, np.roll(corners, -1), strict=True):
            sides.setdefault((int(min(i, j)), int(max(i, j))), set()).add(int(k))
    return tuple(sorted(edge for edge, faces in sides.items() if len(faces) > 1))


def _tetrahedron(points: np.ndarray) -> list[int]:
    """Four points to start from, each the farthest from the point, the line and the plane before it."""
    first = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    apart = points - points[first]
    second = int(np.argmax(np.linalg.norm(apart, axis=1)))
    third = int(np.argmax(np.linalg.norm(np.cross(apart, apart[second]), axis=1)))
    return [first, second, third, int(np.argmax(np.abs(apart @ np.cross(apart[second], apart[third]))))]


def _exchanged(points: np.ndarray, chosen: list[int]) -> list[int]:
    """The same with some exchanged, until none brings the farthest nearer."""
    beyond = _beyond(points, points[chosen])
    while True:
        more = [*chosen, int(np.argmax(beyond))]
        choices = [more[:k] + more[k + 1 :] for k in range(len(chosen))]
        others = [_beyond(points, points[choice]) for choice in choices]
        best = min(range(len(choices)), key=lambda k: others[k].max())
        if others[best].max() >= beyond.max():
            return chosen
        chosen, beyond = choices[best], others[best]


def _beyond(points: np.ndarray, some: np.ndarray) -> np.ndarray:
    """How far points are outside the planes of some others' hull, shape (n,); infinite, if that is flat [m]."""
    try:
        equations = ConvexHull(some).equations
    except QhullError:
        return np.full(len(points), np.inf)
    return (points @ equations[:, :3].T + equations[:, 3]).max(axis=1)


def _shortfall(points: np.ndarray, some: np.ndarray) -> float:
    """The largest distance of a point from the hull of some others [m]."""
    from trimesh.triangles import closest_point

    outside = points[_beyond(points, some) > 1e-12 * np.ptp(points)]
    triangles = some[_hull(some)]
    if not len(outside):
        return 0.0
    each, all_of = np.repeat(outside, len(triangles), axis=0), np.tile(triangles, (len(outside), 1, 1))
    distances = np.linalg.norm(closest_point(all_of, each) - each, axis=1)
    return float(distances.reshape(len(outside), -1).min(axis=1).max())


def _point(x: np.ndarray) -> Point:
    a, b, c = (x + 0.0).tolist()
    return a, b, c
