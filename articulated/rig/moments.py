"""Integrals over the volume of a solid, whatever it is made of.

symbol   meaning                                    unit
volume   ∫ dV                                       m³
center   ∫ x dV / volume                            m
second   ∫ (x − center)(x − center)ᵀ dV             m⁵

The rotational inertia is trace(second) 1 − second, for a density of 1 (RBDA 2.61).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from articulated.rig.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Sphere


@dataclass(frozen=True, eq=False)
class Moments:
    """The integrals, in one frame; see above."""

    volume: float
    center: np.ndarray
    second: np.ndarray

    @property
    def inertia(self) -> np.ndarray:
        """About the centre, for a density of 1, shape (3, 3) [m⁵]."""
        return np.trace(self.second) * np.eye(3) - self.second

    def mapped(self, A: np.ndarray, p: np.ndarray) -> Moments:
        """Of the solid that x ↦ A x + p makes of this one; A, shape (3, 3), may turn, stretch and mirror."""
        stretch = abs(float(np.linalg.det(A)))
        return Moments(stretch * self.volume, A @ self.center + p, stretch * (A @ self.second @ A.T))


def together(parts: Sequence[Moments]) -> Moments:
    """Of several solids as one, by the parallel-axis theorem; where they overlap, each counts."""
    volume = sum(part.volume for part in parts)
    center = np.sum([part.volume * part.center for part in parts], axis=0) / volume
    offsets = [part.center - center for part in parts]
    second = np.sum([part.second + part.volume * np.outer(d, d) for part, d in zip(parts, offsets, strict=True)], axis=0)
    return Moments(volume, center, second)


def moments_of(geometry: Sphere | Box | Cylinder | Capsule | Cone | Ellipsoid) -> Moments:
    """Of a plain shape, in closed form; its axes are principal, and its centre is the origin but for a cone."""
    if isinstance(geometry, Box):
        lengths = np.array(geometry.size, dtype=float)
        volume = float(np.prod(lengths))
        return _symmetric(volume, volume * lengths**2 / 12.0)
    if isinstance(geometry, Ellipsoid):
        radii = np.array(geometry.radii, dtype=float)
        volume = 4.0 / 3.0 * pi * float(np.prod(radii))
        return _symmetric(volume, volume * radii**2 / 5.0)
    r = float(geometry.radius)
    ball = 4.0 / 3.0 * pi * r**3
    if isinstance(geometry, Sphere):
        return _symmetric(ball, np.full(3, ball * r**2 / 5.0))
    l = float(geometry.length)
    if isinstance(geometry, Cone):
        volume, across = pi * r**2 * l / 3.0, 3.0 / 20.0 * r**2
        return Moments(volume, np.array([0.0, 0.0, -0.25 * l]), volume * np.diag([across, across, 3.0 / 80.0 * l**2]))
    shaft = pi * r**2 * l
    shaft_across, shaft_along = shaft * r**2 / 4.0, shaft * l**2 / 12.0
    if isinstance(geometry, Cylinder):
        return _symmetric(shaft, np.array([shaft_across, shaft_across, shaft_along]))
    # the caps: two half balls, whose points lie l/2 farther out: ∫ (|z| + l/2)² dV, with ∫ |z| dV = ball · 3r/8
    caps_across, caps_along = ball * r**2 / 5.0, ball * (r**2 / 5.0 + 3.0 * r * l / 8.0 + l**2 / 4.0)
    across = shaft_across + caps_across
    return _symmetric(shaft + ball, np.array([across, across, shaft_along + caps_along]))


def moments_within(triangles: np.ndarray) -> Moments:
    """Of the solid that triangles enclose: the sum of the tetrahedra that they make with the origin, each with its sign.

    B. Mirtich, "Fast and accurate computation of polyhedral mass properties", J. Graphics Tools 1(2), 1996, whose integrals of
    degree 0, 1 and 2 are here those of a tetrahedron with corners 0, a, b, c and volume V = det(a, b, c)/6:
    V, V (a + b + c)/4 and V (a aᵀ + b bᵀ + c cᵀ + (a + b + c)(a + b + c)ᵀ)/20.

    Args:
        triangles: their corners, anticlockwise seen from outside, shape (n, 3, 3). The origin should be near: the solid is
            re-centred only to the second moments.
    """
    volumes, sums = np.linalg.det(triangles) / 6.0, triangles.sum(axis=1)
    volume = float(volumes.sum())
    center = volumes @ sums / (4.0 * volume)
    corners = np.concatenate([triangles - center, (sums - 3.0 * center)[:, None]], axis=1)
    # about the centre found: there the tetrahedra have other volumes
    volumes = np.linalg.det(corners[:, :3]) / 6.0
    second = np.einsum("n,nki,nkj->ij", volumes, corners, corners) / 20.0
    return Moments(volume, center, second)


def _symmetric(volume: float, second: np.ndarray) -> Moments:
    return Moments(volume, np.zeros(3), np.diag(second))
