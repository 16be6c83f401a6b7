"""Where candidates stand to the ground: gaps, normals and points of contact, over scalars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, absolute, lookup, maximum, minimum, nearest, sqrt, where
from articulated.simulation.contact.candidates import Candidate
from articulated.simulation.contact.narrow.placed import UPRIGHT
from articulated.simulation.contact.surfaces import Blocks, HeightField, Plane, Solid
from articulated.simulation.scene import Scene
from articulated.spatial import Pose, Vec3

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


def _gap(candidate: Candidate, X_OL: Pose, origin: Vec3, surface: Solid, table: Any) -> Gap:
    """The gap of a candidate of the link with this pose about O, which stands at `origin` in the world."""
    center = X_OL.transform_point(Vec3.of(candidate.center))
    ground = _tangent(surface, table, origin + center)
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


def _tangent(surface: Solid, table: Any, p: Vec3) -> _Tangent:
    """The plane that touches a surface where it is nearest to a point of the world, or, for terrain, below it."""
    if isinstance(surface, Plane):
        return _plane(surface)
    return _terrain(surface, table, p) if isinstance(surface, HeightField) else _block(surface, p)


def _plane(surface: Plane) -> _Tangent:
    offset = sum(a * b for a, b in zip(surface.normal, surface.point, strict=True))
    return _Tangent(Vec3.of(surface.normal), offset)


def _terrain(field: HeightField, table: Any, p: Vec3) -> _Tangent:
    """The plane that touches the field's surface above or below a point."""
    (rows, columns), (dx, dy), (x0, y0, z0) = field.heights.shape, field.spacing, field.origin
    across, along = _near((p.x - x0) * (1.0 / dx), columns), _near((p.y - y0) * (1.0 / dy), rows)
    z, slope_x, slope_y = z0, 0.0, 0.0
    for j, w_y, dw_y in along:
        row, slope = 0.0, 0.0
        for i, w_x, dw_x in across:
            height = lookup(table, j * float(columns) + i)
            row, slope = row + w_x * height, slope + dw_x * height
        z, slope_x, slope_y = z + w_y * row, slope_x + w_y * slope, slope_y + dw_y * row
    slope_x, slope_y = slope_x * (1.0 / dx), slope_y * (1.0 / dy)
    scale = 1.0 / sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
    normal = Vec3(-(slope_x * scale), -(slope_y * scale), scale)
    return _Tangent(normal, normal.dot(Vec3(p.x, p.y, z)))


def _near(x: Scalar, count: int) -> list[tuple[Scalar, Scalar, Scalar]]:
    """The three lines of a grid next to x: number, weight in a quadratic spline, and how the weight changes with x.

    Beyond the grid, its last line goes on.
    """
    k = minimum(maximum(nearest(x), 0.0), count - 1.0)
    t = minimum(maximum(x - k, -0.5), 0.5)
    low, high, inside = 0.5 - t, 0.5 + t, where(absolute(x - k) <= 0.5, 1.0, 0.0)
    return [
        (maximum(k - 1.0, 0.0), 0.5 * low * low, -(inside * low)),
        (k, 0.75 - t * t, -2.0 * inside * t),
        (minimum(k + 1.0, count - 1.0), 0.5 * high * high, inside * high),
    ]


def _block(blocks: Blocks, p: Vec3) -> _Tangent:
    """Of the block that is below a point, or the one before it: a quarter of space, solid behind its side and below its top."""
    stairs = blocks.stairs
    x0, y0, z0 = stairs.start
    up = _way_up(blocks)
    x, z = up.dot(p - Vec3(x0, y0, 0.0)), p.z - z0
    below = minimum(maximum(nearest(x * (1.0 / stairs.run) - 0.5), -1.0), stairs.count - 1.0)
    odd = below - 2.0 * nearest(0.5 * below - 0.25)
    k = where(odd > 0.5, below, below + 1.0) if blocks.odd else where(odd > 0.5, below + 1.0, below)
    before = where(k < 0.0, -_FAR, stairs.run * k - x)
    above = z - stairs.rise * (k + 1.0)
    corner = (before > 0.0) & (above > 0.0)
    reach = sqrt(where(corner, before * before + above * above, 1.0))
    size = where(k < stairs.count - 0.5, where(corner, reach, maximum(before, above)), _FAR)
    back = where(corner, before / reach, where(before > above, 1.0, 0.0))
    normal = Vec3(-(back * up.x), -(back * up.y), where(corner, above / reach, where(before > above, 0.0, 1.0)))
    return _Tangent(normal, normal.dot(p) - size)


def _way_up(blocks: Blocks) -> Vec3:
    return Vec3(math.cos(blocks.stairs.heading), math.sin(blocks.stairs.heading), 0.0)


def spread(surface: Solid, normal: Vec3, two: Sequence[Scalar]) -> Vec3:
    """The vector along the ground that has these two numbers: its parts along two tangents, or, on terrain, along x and y."""
    if isinstance(surface, HeightField):
        return Vec3(two[0], two[1], -((normal.x * two[0] + normal.y * two[1]) / normal.z))
    a, b = _tangents(surface, normal)
    return a * two[0] + b * two[1]


def folded(surface: Solid, normal: Vec3, along: Vec3) -> list[Scalar]:
    """The reverse of `spread`."""
    if isinstance(surface, HeightField):
        return [along.x, along.y]
    return [axis.dot(along) for axis in _tangents(surface, normal)]


def _tangents(surface: Plane | Blocks, normal: Vec3) -> tuple[Vec3, Vec3]:
    """Two unit vectors along a plane, or along a step: level, and square to it."""
    if isinstance(surface, Blocks):
        up = _way_up(surface)
        level = Vec3(-up.y, up.x, 0.0)
        return level, normal.cross(level)
    n = surface.normal
    k = min((2, 1, 0), key=lambda axis: (abs(n[(axis + 1) % 3]), axis))  # the axis after it lies most nearly in the plane
    a = Vec3.of([1.0 if axis == (k + 1) % 3 else 0.0 for axis in range(3)])
    normal = Vec3.of(n)
    a = a - normal * normal.dot(a)
    a = a * (1.0 / a.dot(a) ** 0.5)
    return a, normal.cross(a)
