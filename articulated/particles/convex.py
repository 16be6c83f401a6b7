"""Colliders in their own axes, about the origin: what shapes of links are to particles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from articulated.particles.check import numbers, positive, settle
from articulated.particles.colliders import Collider
from articulated.scalar import Scalar, absolute, either, maximum, sqrt, where
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class Cylinder(Collider):
    """A cylinder along z.

    Attributes:
        radius, length: its full height [m].
        restitution, friction: of its surface.
    """

    radius: float
    length: float
    restitution: float = 0.0
    friction: float = 0.0
    convex: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("radius", "length"):
            settle(self, **{name: positive(f"Cylinder: {name}", getattr(self, name))})
        self._check_surface()

    @property
    def reach(self) -> float:
        return float(np.hypot(self.radius, 0.5 * self.length))

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        square = x.x * x.x + x.y * x.y
        is_off = square > 0.0
        across = sqrt(where(is_off, square, 1.0))
        side = [where(is_off, c / across, c0) for c, c0 in ((x.x, 1.0), (x.y, 0.0))]
        beside = where(is_off, across, 0.0) - self.radius
        above, up = absolute(x.z) - 0.5 * self.length, where(x.z < 0.0, -1.0, 1.0)
        out, over = maximum(beside, 0.0), maximum(above, 0.0)
        outside = out * out + over * over
        is_outside = outside > 0.0
        distance = sqrt(where(is_outside, outside, 1.0))
        to_side = above < beside
        near = either(to_side, (beside, 1.0, 0.0), (above, 0.0, 1.0))
        gap, a, b = either(is_outside, (distance, out / distance, over / distance), near)
        return gap, Vec3(side[0] * a, side[1] * a, up * b)


@dataclass(frozen=True, eq=False)
class Hull(Collider):
    """The convex hull of points; off its corners it is told nearer than it is, never farther.

    Attributes:
        points: shape (n, 3) [m].
        restitution, friction: of its surface.
    """

    points: Any
    restitution: float = 0.0
    friction: float = 0.0
    convex: ClassVar[bool] = True

    def __post_init__(self) -> None:
        from scipy.spatial import ConvexHull, QhullError

        points = numbers("Hull: points", self.points, (None, 3))
        try:
            faces = np.unique(np.round(ConvexHull(points).equations, 12), axis=0)
        except (QhullError, ValueError):
            raise ValueError("Hull: points lie in a plane, or are less than four; expected a solid") from None
        settle(self, points=points, _faces=faces)
        self._check_surface()

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.points, axis=1).max())

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        gap, n = None, Vec3.zero()
        for a, b, c, d in self._faces.tolist():  # type: ignore[attr-defined]
            here = a * x.x + b * x.y + c * x.z + d
            gap, n = (here, Vec3(a, b, c)) if gap is None else either(gap < here, (here, Vec3(a, b, c)), (gap, n))
        return gap, n
