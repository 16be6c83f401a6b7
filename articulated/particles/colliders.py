"""What particles run into: planes, spheres, capsules and boxes, as distances.

A collider is known by how far a point is from it and which way is out. So a particle on its way cannot pass through one unseen,
however fast: steps along its path as long as the distance that is left never go past the surface (Hart, Sphere Tracing, 1996).
Nor do steps to the plane that touches a convex one, by Newton's method, which get on where the way grazes the surface, too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from articulated.particles.check import numbers, positive, settle, vector
from articulated.scalar import Scalar, absolute, maximum, minimum, sqrt, where
from articulated.spatial import Mat3, Vec3

_MARCHES, _CONVEX_MARCHES = 24, 12
"""Steps along a path; those that graze a surface take most."""
NEAR, LIFT = 1e-9, 1e-10
"""What is nearer to a surface than this has reached it, and is put so far above it: no rounding takes it away again [m]."""
_TINY = 1e-30


class Collider(ABC):
    """Something that particles cannot enter.

    Attributes:
        restitution: k_r: what comes in with a speed leaves with this part of it, from 0 to 1.
        friction: μ, Coulomb's.
        compiles: whether machine code can ask it; of all of a kind.
        convex: whether it is known to be; of all of a kind.
    """

    restitution: float
    friction: float
    compiles: ClassVar[bool] = True
    convex: ClassVar[bool] = False

    def _check_surface(self) -> None:
        name = type(self).__name__
        restitution = positive(f"{name}: restitution", self.restitution, zero=True)
        if restitution > 1.0:
            raise ValueError(f"{name}: restitution is {restitution:g}; expected 0 to 1: more would make energy")
        settle(self, restitution=restitution, friction=positive(f"{name}: friction", self.friction, zero=True))

    @property
    def reach(self) -> float:
        """The radius of the ball about the origin that holds it [m]."""
        return float(np.inf)

    @abstractmethod
    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        """How far a point is outside, negative inside [m], and the unit normal there, outwards."""

    def velocity(self, t: Scalar, x: Vec3) -> Vec3:
        """Of its surface at a point [m/s]."""
        return Vec3.zero()

    def crossing(self, t: Scalar, h: Scalar, x: Vec3, y: Vec3) -> tuple[Scalar, Scalar]:
        """Where a way from x to y, from time t to t + h, first meets it: the part of the way, and whether it does.

        What is convex is behind the plane that touches it, square to the normal: so far steps may go, farther than the gap.
        """
        way = y - x
        length = sqrt(way.dot(way))
        s = 0.0 * length
        for _ in range(_CONVEX_MARCHES if self.convex else _MARCHES):
            gap, n = self.gap(t + s * h, x + way * s)
            nearing = -n.dot(way) if self.convex else length
            nears = nearing > _TINY
            step = where(nears, (gap - LIFT) / where(nears, nearing, 1.0), 1.0)
            s = minimum(s + where(gap > NEAR, step, 0.0), 1.0)
        gap, n = self.gap(t + s * h, x + way * s)
        return s, (gap <= NEAR) & (n.dot(way) < NEAR)

    def onward(self, t: Scalar, h: Scalar, x: Vec3, y: Vec3) -> Vec3:
        """Where what leaves its surface at x for y comes to: to y, unless it is hollow and is met again."""
        return y


@dataclass(frozen=True, eq=False)
class Plane(Collider):
    """All that is behind a plane.

    Attributes:
        normal: outwards, shape (3,), of any length.
        point: of the plane, shape (3,) [m].
        restitution, friction: of its surface.
    """

    normal: Any = (0.0, 0.0, 1.0)
    point: Any = (0.0, 0.0, 0.0)
    restitution: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        settle(self, normal=_unit("Plane: normal", self.normal), point=vector("Plane: point", self.point))
        self._check_surface()

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        n = Vec3.of(self.normal.tolist())
        return n.dot(x) - float(self.normal @ self.point), n

    def crossing(self, t: Scalar, h: Scalar, x: Vec3, y: Vec3) -> tuple[Scalar, Scalar]:
        (before, _), (after, _) = self.gap(t, x), self.gap(t + h, y)
        falls = (before > NEAR) & (after < before)
        s = where(falls, (before - LIFT) / where(falls, before - after, 1.0), 0.0)
        return minimum(s, 1.0), (after <= NEAR) & (after < before + NEAR)


@dataclass(frozen=True, eq=False)
class Sphere(Collider):
    """A ball.

    Attributes:
        center: shape (3,) [m].
        radius: [m].
        restitution, friction: of its surface.
    """

    center: Any
    radius: float
    restitution: float = 0.0
    friction: float = 0.0
    convex: ClassVar[bool] = True

    def __post_init__(self) -> None:
        settle(self, center=vector("Sphere: center", self.center), radius=positive("Sphere: radius", self.radius))
        self._check_surface()

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.center)) + self.radius

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        return _outside(x - Vec3.of(self.center.tolist()), self.radius)


@dataclass(frozen=True, eq=False)
class Capsule(Collider):
    """All that is nearer to a line than its radius.

    Attributes:
        ends: of the line, shape (2, 3) [m].
        radius: [m].
        restitution, friction: of its surface.
    """

    ends: Any
    radius: float
    restitution: float = 0.0
    friction: float = 0.0
    convex: ClassVar[bool] = True

    def __post_init__(self) -> None:
        settle(self, ends=numbers("Capsule: ends", self.ends, (2, 3)), radius=positive("Capsule: radius", self.radius))
        self._check_surface()

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.ends, axis=1).max()) + self.radius

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        a, b = (Vec3.of(end.tolist()) for end in self.ends)
        along, r = b - a, x - a
        square = along.dot(along)
        s = minimum(maximum(r.dot(along) * (1.0 / square if square > 0.0 else 0.0), 0.0), 1.0)
        return _outside(r - along * s, self.radius)


@dataclass(frozen=True, eq=False)
class Box(Collider):
    """A box.

    Attributes:
        center: shape (3,) [m].
        size: its three lengths, shape (3,) [m].
        axes: their directions as columns, a rotation, shape (3, 3).
        restitution, friction: of its surface.
    """

    center: Any
    size: Any
    axes: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    restitution: float = 0.0
    friction: float = 0.0
    convex: ClassVar[bool] = True

    def __post_init__(self) -> None:
        center, size, axes = (
            vector("Box: center", self.center),
            vector("Box: size", self.size),
            numbers("Box: axes", self.axes, (3, 3)),
        )
        if not (size > 0.0).all():
            raise ValueError(f"Box: size is {size.tolist()}; expected three lengths above zero")
        if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-6 or np.linalg.det(axes) < 0.0:
            raise ValueError("Box: axes are no rotation; give it three unit vectors, square to each other, as columns")
        settle(self, center=center, size=size, axes=axes)
        self._check_surface()

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.center) + 0.5 * np.linalg.norm(self.size))

    def gap(self, t: Scalar, x: Vec3) -> tuple[Scalar, Vec3]:
        R = Mat3.of(self.axes.tolist())
        local = R.transpose_times(x - Vec3.of(self.center.tolist()))
        beyond = [absolute(c) - 0.5 * float(size) for c, size in zip(local, self.size, strict=True)]
        deepest = maximum(maximum(beyond[0], beyond[1]), beyond[2])
        out = Vec3(*(maximum(c, 0.0) for c in beyond))
        square = out.dot(out)
        is_outside = square > 0.0
        distance = sqrt(where(is_outside, square, 1.0))
        taken, parts = 0.0, []
        for c, sign in zip(beyond, local, strict=True):
            is_face = where(c < deepest, 0.0, 1.0 - taken)  # inside, the first of the nearest faces
            taken = taken + is_face
            part = where(is_outside, maximum(c, 0.0) / distance, is_face)
            parts.append(where(sign < 0.0, -part, part))
        return where(is_outside, distance, deepest), R @ Vec3(*parts)


def _outside(r: Vec3, radius: float) -> tuple[Scalar, Vec3]:
    """Of a ball in whose axes a point is at r."""
    square = r.dot(r)
    is_off = square > 0.0
    distance = sqrt(where(is_off, square, 1.0))
    n = r * where(is_off, 1.0 / distance, 0.0)
    return where(is_off, distance, 0.0) - radius, Vec3(n.x, n.y, where(is_off, n.z, 1.0))


def _unit(name: str, value: Any) -> np.ndarray:
    array = vector(name, value)
    length = float(np.linalg.norm(array))
    if not length > 0.0:
        raise ValueError(f"{name} is the zero vector; give it a direction")
    return array / length
