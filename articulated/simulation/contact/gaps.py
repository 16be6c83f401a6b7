"""Where candidates stand to the ground: gaps, normals and points of contact, over scalars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, absolute, lookup, maximum, minimum, nearest, sqrt, where
from articulated.simulation.contact.candidates import Candidate
from articulated.simulation.contact.ground import HeightField, Plane, Surface
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


@dataclass(frozen=True, eq=False)
class _Tangent:
    """The ground as a plane, where a candidate is: height above it is normal · (O + p) − offset."""

    normal: Vec3
    offset: Scalar


def gaps(scene: Scene, now: Tree, tables: Sequence[Any]) -> list[Gap]:
    """Of all contacts, in their order; `tables` has the heights of each height field."""
    result = []
    for candidate in scene.candidates:
        body, X_BL = scene.mechanism.links[candidate.link]
        X_OL, given = now.X[body] @ X_BL, iter(tables)
        for surface in scene.surfaces:
            result.append(_gap(candidate, X_OL, now.origin, surface, next(given) if isinstance(surface, HeightField) else None))
    return result


def _gap(candidate: Candidate, X_OL: Pose, origin: Vec3, surface: Surface, table: Any) -> Gap:
    """The gap of a candidate of the link with this pose about O, which stands at `origin` in the world."""
    center = X_OL.transform_point(Vec3.of(candidate.center))
    ground = _plane(surface) if isinstance(surface, Plane) else _terrain(surface, table, origin + center)
    normal = ground.normal

    def height(point: Vec3) -> Scalar:
        return normal.dot(origin) + normal.dot(point) - ground.offset

    if candidate.axis is None:
        point = center - normal * candidate.radius
        return Gap(height(point), normal, point)
    axis = X_OL.R @ Vec3.of(candidate.axis)
    tilt = axis.dot(normal)
    if candidate.upright:
        return Gap(where(absolute(tilt) > UPRIGHT, height(center), _FAR), normal, center)
    # the lowest point of the rim lies where the normal's part in its plane points away from
    across = normal - axis * tilt
    point = center - across * (candidate.radius / sqrt(across.dot(across) + _POINTED))
    return Gap(height(point), normal, point)


def _plane(surface: Plane) -> _Tangent:
    offset = sum(a * b for a, b in zip(surface.normal, surface.point, strict=True))
    return _Tangent(Vec3.of(surface.normal), offset)


def _terrain(field: HeightField, table: Any, p: Vec3) -> _Tangent:
    """The plane that touches the bilinear surface above or below a point."""
    (rows, columns), (dx, dy), (x0, y0, z0) = field.heights.shape, field.spacing, field.origin
    i, s, inside_x = _cell((p.x - x0) * (1.0 / dx), columns)
    j, t, inside_y = _cell((p.y - y0) * (1.0 / dy), rows)
    first = j * float(columns) + i
    a, b, c, d = (lookup(table, first + float(k)) for k in (0, 1, columns, columns + 1))
    low, high = a + s * (b - a), c + s * (d - c)
    slope_x = inside_x * (1.0 / dx) * ((b - a) + t * ((d - c) - (b - a)))
    slope_y = inside_y * (1.0 / dy) * (high - low)
    z = low + t * (high - low) + z0
    scale = 1.0 / sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
    normal = Vec3(-(slope_x * scale), -(slope_y * scale), scale)
    return _Tangent(normal, normal.dot(Vec3(p.x, p.y, z)))


def _cell(x: Scalar, count: int) -> tuple[Scalar, Scalar, Scalar]:
    """The cell of a grid that x is in, how far in it, from 0 to 1, and 1 if it is on the grid at all, else 0."""
    on = minimum(maximum(x, 0.0), count - 1.0)
    cell = minimum(maximum(nearest(on - 0.5), 0.0), count - 2.0)
    return cell, on - cell, where(on == x, 1.0, 0.0)


def spread(surface: Surface, normal: Vec3, two: Sequence[Scalar]) -> Vec3:
    """The vector along the ground that has these two numbers: its parts along two tangents of a plane, or along x and y."""
    if isinstance(surface, Plane):
        a, b = _tangents(surface)
        return a * two[0] + b * two[1]
    return Vec3(two[0], two[1], -((normal.x * two[0] + normal.y * two[1]) / normal.z))


def folded(surface: Surface, along: Vec3) -> list[Scalar]:
    """The reverse of `spread`."""
    if isinstance(surface, Plane):
        return [axis.dot(along) for axis in _tangents(surface)]
    return [along.x, along.y]


def _tangents(surface: Plane) -> tuple[Vec3, Vec3]:
    """Two unit vectors along a plane."""
    n = surface.normal
    k = min((2, 1, 0), key=lambda axis: (abs(n[(axis + 1) % 3]), axis))  # the axis after it lies most nearly in the plane
    a = Vec3.of([1.0 if axis == (k + 1) % 3 else 0.0 for axis in range(3)])
    normal = Vec3.of(n)
    a = a - normal * normal.dot(a)
    a = a * (1.0 / a.dot(a) ** 0.5)
    return a, normal.cross(a)
