"""Where candidates stand to the ground: gaps, normals and points of contact, over scalars."""

from __future__ import annotations

from dataclasses import dataclass

from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, absolute, sqrt, where
from articulated.simulation.contact.candidates import Candidate
from articulated.simulation.contact.ground import Plane
from articulated.simulation.scene import Scene
from articulated.spatial import Pose, Vec3

UPRIGHT = 0.9
"""Cosine between a cylinder's axis and the ground's normal from which it counts as standing."""
_POINTED = 1e-6
_FAR = 1e3


@dataclass(frozen=True, eq=False)
class Gap:
    """Between a candidate and a surface.

    Attributes:
        size: distance along the normal, negative where it is inside [m].
        normal: of the ground there.
        point: the candidate's nearest point, about O.
    """

    size: Scalar
    normal: Vec3
    point: Vec3


def gaps(scene: Scene, now: Tree) -> list[Gap]:
    """Of all contacts, in their order."""
    result = []
    for candidate in scene.candidates:
        body, X_BL = scene.mechanism.links[candidate.link]
        X_OL = now.X[body] @ X_BL
        result += [_gap(candidate, X_OL, now.origin, surface) for surface in scene.surfaces]
    return result


def _gap(candidate: Candidate, X_OL: Pose, origin: Vec3, surface: Plane) -> Gap:
    """The gap of a candidate of the link with this pose about O, which stands at `origin` in the world."""
    center = X_OL.transform_point(Vec3.of(candidate.center))
    normal = Vec3.of(surface.normal)
    below = sum(a * b for a, b in zip(surface.normal, surface.point, strict=True))
    if candidate.axis is None:
        point = center - normal * candidate.radius
        return Gap(normal.dot(origin) + normal.dot(point) - below, normal, point)
    axis = X_OL.R @ Vec3.of(candidate.axis)
    tilt = axis.dot(normal)
    if candidate.upright:
        height = normal.dot(origin) + normal.dot(center) - below
        return Gap(where(absolute(tilt) > UPRIGHT, height, _FAR), normal, center)
    # the lowest point of the rim lies where the normal's part in its plane points away from
    across = normal - axis * tilt
    point = center - across * (candidate.radius / sqrt(across.dot(across) + _POINTED))
    return Gap(normal.dot(origin) + normal.dot(point) - below, normal, point)


def tangents(surface: Plane) -> tuple[Vec3, Vec3]:
    """Two unit vectors along a plane."""
    n = surface.normal
    k = min((2, 1, 0), key=lambda axis: (abs(n[(axis + 1) % 3]), axis))  # the axis after it lies most nearly in the plane
    a = Vec3.of([1.0 if axis == (k + 1) % 3 else 0.0 for axis in range(3)])
    normal = Vec3.of(n)
    a = a - normal * normal.dot(a)
    a = a * (1.0 / a.dot(a) ** 0.5)
    return a, normal.cross(a)
