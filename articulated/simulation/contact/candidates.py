"""The points of a rig that may touch the ground: of its collision shapes, or chosen by a user.

A ball touches with its lowest point; so do the ends of a capsule, and a box with its corners, which are balls of no radius.
A cylinder touches with the lowest point of each rim, wherever that is: so a wheel rolls smoothly. One that stands on its end
would do so on a single point: on each rim there are fixed points too, which count while it is upright. A mesh touches with some
vertices of its convex hull, those that lie farthest apart.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from articulated.dynamics.boundary import find_link
from articulated.rig import Box, Capsule, Cylinder, Link, Mesh, Rig, Shape, Sphere
from articulated.rig.mesh import found_mesh
from articulated.simulation.contact.polyhedra import corners_of_mesh

_RIM_POINTS = 4
MESH_POINTS = 6
"""Vertices that stand for a mesh."""


@dataclass(frozen=True)
class ContactPoint:
    """A ball on a link that may touch the ground; a mere point if it has no radius.

    Attributes:
        link: name of the link.
        position: its centre, in the link's frame [m].
        radius: [m].
    """

    link: str
    position: tuple[float, float, float]
    radius: float = 0.0


@dataclass(frozen=True)
class Candidate:
    """What may touch the ground, on a link, in its frame.

    Attributes:
        link: index of the link.
        center: of a ball, or of a rim [m].
        radius: of the ball, or the rim [m].
        axis: of a rim: unit vector along the cylinder, outwards; None for a ball.
        upright: whether it is a fixed point of a rim that counts only while the cylinder's axis is near the ground's normal.
    """

    link: int
    center: tuple[float, float, float]
    radius: float
    axis: tuple[float, float, float] | None = None
    upright: bool = False


def candidates(rig: Rig, points: Sequence[ContactPoint | str] | None) -> tuple[Candidate, ...]:
    """Of a user's points, and links by name with all their collision shapes; None takes all links that move.

    Raises:
        ValueError: there is no such link, or it does not move; a point is impossible; a mesh cannot be read.
    """
    if points is None:
        points = [link.name for link in rig.links.values() if link.body >= 0]
    if isinstance(points, (str, ContactPoint)):
        raise ValueError(f"contact_points is {points!r}; expected a list of points and names of links")
    return tuple(c for point in points for c in _chosen(rig, point))


def _chosen(rig: Rig, point: ContactPoint | str) -> list[Candidate]:
    if not isinstance(point, (str, ContactPoint)):
        raise ValueError(f"contact_points holds {point!r}; expected ContactPoint(link, position, radius) or the name of a link")
    link = find_link(rig, point if isinstance(point, str) else point.link)
    if link.body < 0:
        raise ValueError(f"contact_points: link {link.name!r} is fixed to the world, and will never touch the ground")
    if isinstance(point, str):
        return [c for shape in link.collisions for c in _of_shape(link, shape)]
    numbers = np.asarray([*point.position, point.radius], dtype=float)
    if numbers.shape != (4,) or not np.isfinite(numbers).all() or point.radius < 0.0:
        raise ValueError(f"{point!r}: expected three finite numbers, and a radius of zero or more")
    return [_ball(link, np.eye(4), point.position, point.radius)]


def _of_shape(link: Link, shape: Shape) -> list[Candidate]:
    geometry, pose = shape.geometry, shape.pose
    if isinstance(geometry, Sphere):
        return [_ball(link, pose, (0.0, 0.0, 0.0), geometry.radius)]
    if isinstance(geometry, Capsule):
        return [_ball(link, pose, (0.0, 0.0, z), geometry.radius) for z in (-0.5 * geometry.length, 0.5 * geometry.length)]
    if isinstance(geometry, Box):
        corners = itertools.product(*((-0.5 * size, 0.5 * size) for size in geometry.size))
        return [_ball(link, pose, corner, 0.0) for corner in corners]
    if isinstance(geometry, Cylinder):
        return [c for side in (-1.0, 1.0) for c in _rim(link, pose, geometry, side)]
    return [_ball(link, pose, vertex, 0.0) for vertex in _vertices(link, geometry)]


def _vertices(link: Link, mesh: Mesh) -> tuple[tuple[float, float, float], ...]:
    """What stands for a mesh."""
    path = found_mesh(mesh, f"of link {link.name!r}")
    return () if path is None else _farthest(path, path.stat().st_mtime_ns, mesh.scale)


@lru_cache(maxsize=1024)
def _farthest(path: Path, _: int, scale: tuple[float, float, float]) -> tuple[tuple[float, float, float], ...]:
    """Vertices of a mesh's convex hull, each as far as can be from those before it (Gonzalez 1985)."""
    vertices = corners_of_mesh(path, scale)
    chosen = [int(np.argmax(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(vertices - vertices[chosen[0]], axis=1)
    while len(chosen) < MESH_POINTS and distance.max() > 0.0:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(vertices - vertices[chosen[-1]], axis=1))
    return tuple(tuple(vertex) for vertex in vertices[chosen].tolist())


def _rim(link: Link, pose: np.ndarray, cylinder: Cylinder, side: float) -> list[Candidate]:
    height, radius = 0.5 * side * cylinder.length, cylinder.radius
    x, y, z = (side * pose[:3, 2]).tolist()
    axis = (x + 0.0, y + 0.0, z + 0.0)
    lowest = Candidate(link.index, _place(pose, (0.0, 0.0, height)), radius, axis)
    angles = [2.0 * math.pi * k / _RIM_POINTS for k in range(_RIM_POINTS)]
    fixed = [(radius * math.cos(a), radius * math.sin(a), height) for a in angles]
    return [lowest, *(Candidate(link.index, _place(pose, p), 0.0, axis, upright=True) for p in fixed)]


def _ball(link: Link, pose: np.ndarray, center: Sequence[float], radius: float) -> Candidate:
    return Candidate(link.index, _place(pose, center), float(radius))


def _place(X: np.ndarray, p: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = (X[:3, :3] @ np.asarray(p, dtype=float) + X[:3, 3]).tolist()
    return x + 0.0, y + 0.0, z + 0.0
