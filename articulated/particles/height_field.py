"""Terrain that particles run into: heights over a grid, and a smooth surface between them.

The surface is the quadratic spline of a rig's ground (see `articulated.HeightField`, and docs/decisions/0011), a patch about
each point of the grid. How far away it is no formula tells; that it is no nearer than a plane of its steepest slope would be is
enough for a gap (Hart, Sphere Tracing, 1996, section 3), but not to find out what a fast particle hits: one that flies low over
a plain would make no headway. So a way is followed from patch to patch: in each the surface bends along it by K at most, the
parabola with that bend lies above the surface, and steps as far as the particle stays above that go past nothing.

symbol   meaning
φ, φ′    height above the surface, its rate along the way
K        no less than the second derivative of the surface's height along the way, all over a patch
s        part of the way
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from articulated.particles.check import numbers, settle, vector
from articulated.particles.colliders import LIFT, NEAR, Collider
from articulated.scalar import Scalar, absolute, either, greatest, lookup, maximum, minimum, nearest, repeat, sqrt, where
from articulated.spatial import Vec3

_APPROACHES = 64
"""Steps along a way besides those that end at the border of a patch, of which a straight way has no more than the grid has
lines. What takes longer skims the surface, and counts as on it."""
_NUDGE = 1e-9
"""Who is so near to the next patch is in it, in spacings."""
_SUNK = 0.25
"""What slides on through a hollow, or bounces into the next hill, comes to a stop for this step if it gets deeper, in spacings;
else it is just put on top."""


@dataclass(frozen=True, eq=False)
class HeightField(Collider):
    """All that is below a terrain: heights over a rectangle of the x-y plane; beyond its edges they go on as at the edge.

    Between them it is smooth, a quadratic spline, which rounds what is sharper than two or three of them. Machine code has no
    tables for particles yet: systems with one run interpreted.

    Attributes:
        heights: z at each point of a grid, shape (rows along y, columns along x), at least 2 by 2 [m].
        spacing: between neighbours, along x and y, or one number for both [m].
        origin: where the first of them stands: x, y, and what is added to all heights [m].
        restitution, friction: of its surface.
        steepest: no slope of it is steeper.
    """

    heights: Any
    spacing: Any
    origin: Any = (0.0, 0.0, 0.0)
    restitution: float = 0.0
    friction: float = 0.0
    steepest: float = field(init=False)
    compiles: ClassVar[bool] = False

    def __post_init__(self) -> None:
        heights = numbers("HeightField: heights", self.heights, (None, None))
        if min(heights.shape) < 2:
            raise ValueError(f"HeightField: heights has shape {heights.shape}; expected two points or more along each axis")
        spacing = np.broadcast_to(self.spacing, 2) if np.ndim(self.spacing) == 0 else self.spacing
        dx, dy = spacing = numbers("HeightField: spacing", spacing, (2,))
        if not (spacing > 0.0).all():
            raise ValueError(f"HeightField: spacing is {self.spacing!r}; expected two positive numbers, along x and y [m]")
        # a spline's slopes are means of those between neighbours
        slopes = np.abs(np.diff(heights, axis=1)).max() / dx, np.abs(np.diff(heights, axis=0)).max() / dy
        heights.setflags(write=False)
        settle(self, heights=heights, spacing=spacing, origin=vector("HeightField: origin", self.origin))
        settle(self, steepest=float(np.hypot(*slopes)))
        self._check_surface()

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        """Outside no more than the distance, and as much on an even slope; inside that to the plane that touches it above."""
        patch = self._patch(x, Vec3.zero())
        above, flat = x.z - patch.height, 1.0 / sqrt(patch.x * patch.x + patch.y * patch.y + 1.0)
        least = 1.0 / float(np.sqrt(1.0 + self.steepest**2))
        return above * where(above > 0.0, least, flat), Vec3(-(patch.x * flat), -(patch.y * flat), flat)

    def crossing(self, t: Scalar, h: Scalar, x: Vec3, y: Vec3) -> tuple[Scalar, Scalar]:
        way, top = y - x, float(self.heights.max() + self.origin[2])

        def ahead(carry: list[Scalar]) -> list[Scalar]:
            s, _ = carry
            p = x + way * s
            patch = self._patch(p, way)
            height, rate = p.z - patch.height, way.z - patch.x * way.x - patch.y * way.y
            # where height + rate s - bend s²/2, which is no more than the true height, comes down to the surface
            above, square = height - LIFT, rate * rate + 2.0 * patch.bend * (height - LIFT)
            root, curves = sqrt(maximum(square, 0.0)), patch.bend > 0.0
            later = where(curves, (rate + root) / where(curves, patch.bend, 1.0), np.inf)
            falls = (square >= 0.0) & (rate < root)
            soon = where(falls, 2.0 * above / where(falls, root - rate, 1.0), np.inf)
            step = minimum(where(rate > 0.0, later, soon), patch.end)
            over = where(way.z < 0.0, (p.z - top) / where(way.z < 0.0, -way.z, 1.0), np.inf)
            step = maximum(step, where(p.z > top, over, 0.0))
            arrived = (height <= NEAR) & (rate < NEAR)
            s = minimum(s + where(arrived, 0.0, step), 1.0)
            return [s, where(arrived | (s >= 1.0), 1.0, 0.0)]

        start = 0.0 * way.x
        s, _ = repeat(sum(self.heights.shape) + _APPROACHES, ahead, [start, start], lambda carry: carry[1] > 0.5)
        p = x + way * s
        gap, n = self.gap(t, p)
        return s, (s < 1.0) | ((gap <= NEAR) & (n.dot(way) < NEAR))

    def onward(self, t: Scalar, h: Scalar, x: Vec3, y: Vec3) -> Vec3:
        up = Vec3(0.0, 0.0, _SUNK * float(self.spacing.min()))
        s, meets = self.crossing(t, h, x + up, y + up)
        return either(meets, x + (y - x) * s + up, y)

    def _patch(self, p: Vec3, way: Vec3) -> _Patch:
        """The surface above or below a point, as one that goes a way sees it."""
        (rows, columns), (dx, dy), (x0, y0, z0) = self.heights.shape, self.spacing.tolist(), self.origin.tolist()
        i, tx, end_x = _place((p.x - x0) * (1.0 / dx), way.x * (1.0 / dx), columns)
        j, ty, end_y = _place((p.y - y0) * (1.0 / dy), way.y * (1.0 / dy), rows)
        table = self.heights.ravel()
        lines = [[lookup(table, b * float(columns) + a) for a in _next(i, columns)] for b in _next(j, rows)]
        across = [_spline(line, tx) for line in lines]
        along = [_spline(list(line), ty) for line in zip(*lines, strict=True)]
        (height, slope_y), (_, slope_x) = _spline([z for z, _ in across], ty), _spline([z for z, _ in along], tx)
        # each second derivative is a mean of those between neighbours
        bends = [greatest([_bend(line) for line in lines]), greatest([_bend(line) for line in zip(*lines, strict=True)])]
        twist = greatest([absolute(_twist(lines, a, b)) for a in (0, 1) for b in (0, 1)])
        u, w = way.x * (1.0 / dx), way.y * (1.0 / dy)
        bend = bends[0] * u * u + bends[1] * w * w + 2.0 * twist * absolute(u * w)
        return _Patch(z0 + height, slope_x * (1.0 / dx), slope_y * (1.0 / dy), bend, minimum(end_x, end_y))


@dataclass(frozen=True, eq=False)
class _Patch:
    """What a particle knows of the surface.

    Attributes:
        height: of the surface at its place [m].
        x, y: slopes there.
        bend: K.
        end: how much of its way leads to the next patch.
    """

    height: Scalar
    x: Scalar
    y: Scalar
    bend: Scalar
    end: Scalar


def _place(u: Scalar, rate: Scalar, count: int) -> tuple[Scalar, Scalar, Scalar]:
    """Along an axis, in spacings: the nearest line of the grid, how far beyond it, and how much of the way to the next patch.

    Patches before the first line and after the last have no end.
    """
    k = minimum(maximum(nearest(u + where(rate > 0.0, _NUDGE, -_NUDGE)), -1.0), float(count))
    goes = where(rate > 0.0, k < count - 0.5, (rate < 0.0) & (k > -0.5))
    end = (k + where(rate > 0.0, 0.5, -0.5) - u) / where(goes, rate, 1.0)
    return k, minimum(maximum(u - k, -0.5), 0.5), where(goes, maximum(end, 0.0), np.inf)


def _next(k: Scalar, count: int) -> list[Scalar]:
    """The three lines next to one; beyond the grid its last line goes on."""
    return [minimum(maximum(k + d, 0.0), count - 1.0) for d in (-1.0, 0.0, 1.0)]


def _spline(z: list[Scalar], t: Scalar) -> tuple[Scalar, Scalar]:
    """The quadratic spline of three heights at t from the middle one, and its slope."""
    low, high = 0.5 - t, 0.5 + t
    return 0.5 * low * low * z[0] + (0.75 - t * t) * z[1] + 0.5 * high * high * z[2], low * (z[1] - z[0]) + high * (z[2] - z[1])


def _bend(z: Any) -> Scalar:
    return z[0] - 2.0 * z[1] + z[2]


def _twist(z: list[list[Scalar]], a: int, b: int) -> Scalar:
    return z[b][a] - z[b][a + 1] - z[b + 1][a] + z[b + 1][a + 1]
