"""Vector fields: of a wind, or of a force; functions of time and place over scalars.

Any function (t, x: Vec3) -> Vec3 that computes with `articulated.scalar` is one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from articulated.particles.check import positive, vector
from articulated.scalar import Scalar, sqrt
from articulated.spatial import Vec3

Field = Callable[[Scalar, Vec3], Vec3]
Wind = Field | Sequence[float] | np.ndarray


def uniform(value: Sequence[float] | np.ndarray) -> Field:
    """The same vector everywhere, shape (3,)."""
    here = Vec3.of(vector("uniform: value", value).tolist())
    return lambda t, x: here


def vortex(
    center: Sequence[float] | np.ndarray, axis: Sequence[float] | np.ndarray, strength: float, core: float = 0.1
) -> Field:
    """A flow around an axis: Γ/(2π) a × r/(r² + c²), with r from the axis; inside the core it turns like a solid.

    Args:
        center: a point of the axis, shape (3,) [m].
        axis: its direction, shape (3,); of any length.
        strength: circulation Γ [m²/s].
        core: its radius c [m].

    Raises:
        ValueError: the axis has no direction, or the core no size.
    """
    a = vector("vortex: axis", axis)
    if not (length := float(np.linalg.norm(a))) > 0.0:
        raise ValueError("vortex: axis is the zero vector; give it a direction")
    middle, along = Vec3.of(vector("vortex: center", center).tolist()), Vec3.of((a / length).tolist())
    square, scale = positive("vortex: core", core) ** 2, strength / (2.0 * np.pi)

    def flow(t: Scalar, x: Vec3) -> Vec3:
        r = x - middle
        r = r - along * along.dot(r)
        return along.cross(r) * (scale / (r.dot(r) + square))

    return flow


def attractor(center: Sequence[float] | np.ndarray, strength: float, core: float = 0.1) -> Field:
    """A pull towards a point: −k r/(r² + c²)^{3/2}, gravity's law softened (Plummer); pushes away if k is negative.

    Args:
        center: shape (3,) [m].
        strength: k [m³/s²].
        core: the distance c within which it weakens [m].

    Raises:
        ValueError: the core has no size.
    """
    middle, square = Vec3.of(vector("attractor: center", center).tolist()), positive("attractor: core", core) ** 2

    def pull(t: Scalar, x: Vec3) -> Vec3:
        r = x - middle
        distance = r.dot(r) + square
        return r * (-strength / (distance * sqrt(distance)))

    return pull


def field_of(value: Wind | None, name: str) -> Field:
    """A field from what a user gives: a function, a vector, or nothing."""
    if value is None:
        return lambda t, x: Vec3.zero()
    if callable(value):
        return value
    return uniform(vector(name, value))
