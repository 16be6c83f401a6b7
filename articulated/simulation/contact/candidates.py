"""The points of a rig that may touch the ground: of its collision shapes, or chosen by a user.

A ball touches with its lowest point; so do the ends of a capsule, and a box with its corners, which are balls of no radius.
A cylinder touches with the lowest point of each rim, wherever that is: so a wheel rolls smoothly. One that stands on its end
would do so on a single point: on each rim there are fixed points too, which count while it is upright.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from articulated.rig import Box, Capsule, Cylinder, Link, Mesh, Rig, Sphere

_RIM_POINTS = 4


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


def candidates(rig: Rig, points: Sequence[ContactPoint] | None) -> tuple[Candidate, ...]:
    """Of a user's points, or of all collision shapes of links that move."""
    if points is not None:
        return tuple(_chosen(rig, point) for point in points)
    return tuple(
        c for link in rig.links.values() if link.body >= 0 for shape in link.collisions for c in _of_shape(link, shape)
    )


def _chosen(rig: Rig, point: ContactPoint) -> Candidate:
    link = rig.links[point.link]
    return _ball(link, np.eye(4), point.position, point.radius)


def _of_shape(link: Link, shape) -> list[Candidate]:
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
    assert isinstance(geometry, Mesh)
    return []


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
