"""Integrals over the walls of hollow shapes, in closed form.

A wall is cut into pieces that only add up, so that no digits are lost however thin it is. Every volume here is divided by the
thickness of the wall: then a shell without thickness is the case 0 of the same formulas, and its "volume" is its area.
The wall of a sphere, and of a cone, is what two similar bodies leave between them, whose centre of similarity is that of
the inscribed ball: an integral of degree n over it is (1 − kⁿ) of that over the outer body, k being the inner one's size.
"""

from __future__ import annotations

from itertools import product
from math import pi

import numpy as np
from scipy.special import elliprg

from articulated.rig.moments import Moments, moments_of, together
from articulated.rig.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Hollow, Sphere, inscribed_radius


def wall_moments(hollow: Hollow) -> Moments:
    """Of the wall of a hollow shape; of one infinitely thin, with its area [m²] as its volume, and [m⁴] as second moments."""
    w = 0.0 if hollow.wall is None else float(hollow.wall)
    part = _per_thickness(hollow.geometry, w)
    return part if hollow.wall is None else Moments(w * part.volume, part.center, w * part.second)


def _per_thickness(outer: Sphere | Box | Cylinder | Capsule | Cone | Ellipsoid, w: float) -> Moments:
    if isinstance(outer, Box):
        return _box(np.array(outer.size, dtype=float), w)
    if isinstance(outer, Cylinder):
        return _cylinder(float(outer.radius), float(outer.length), w)
    if isinstance(outer, Capsule):
        return _capsule(float(outer.radius), float(outer.length), w)
    if isinstance(outer, Ellipsoid):
        return _ellipsoid(np.array(outer.radii, dtype=float), w)
    if isinstance(outer, Cone):
        rho = inscribed_radius(outer)
        return _similar(moments_of(outer), np.array([0.0, 0.0, rho - 0.5 * outer.length]), rho, w)
    return _similar(moments_of(outer), np.zeros(3), float(outer.radius), w)


def _steps(outer: float, inner: float, n: int) -> float:
    """(outerⁿ − innerⁿ) / (outer − inner), also where these are one."""
    return sum(outer ** (n - 1 - k) * inner**k for k in range(n))


def _similar(body: Moments, middle: np.ndarray, rho: float, w: float) -> Moments:
    """Between a body and a similar one, about the centre `middle` of its inscribed ball of radius `rho`."""
    k = 1.0 - w / rho
    zeroth, first, second = (_steps(1.0, k, n) / rho for n in (3, 4, 5))
    c = body.center - middle
    volume, off = zeroth * body.volume, first / zeroth * c
    about_middle = second * (body.second + body.volume * np.outer(c, c))
    return Moments(volume, middle + off, about_middle - volume * np.outer(off, off))


def _slab(lengths: np.ndarray, axis: int, at: float, w: float) -> Moments:
    """A box of thickness w along an axis, over w."""
    sides = lengths.copy()
    sides[axis] = 1.0
    volume, center = float(np.prod(sides)), np.zeros(3)
    sides[axis], center[axis] = w, at
    return Moments(volume, center, np.diag(volume * sides**2 / 12.0))


def _box(lengths: np.ndarray, w: float) -> Moments:
    """Two faces right across, two between these, and two between all four."""
    pieces, left = [], lengths.copy()
    for axis, sign in product(range(3), (1.0, -1.0)):
        pieces.append(_slab(left, axis, sign * 0.5 * (lengths[axis] - w), w))
        if sign < 0.0:
            left[axis] -= 2.0 * w
    return together(pieces)


def _tube(R: float, l: float, w: float) -> Moments:
    r = R - w
    volume, across = pi * _steps(R, r, 2) * l, pi / 4.0 * _steps(R, r, 4) * l
    return Moments(volume, np.zeros(3), np.diag([across, across, volume * l**2 / 12.0]))


def _cylinder(R: float, L: float, w: float) -> Moments:
    """A tube between two lids that reach over it."""
    area, across = pi * R**2, pi / 4.0 * R**4
    lid = np.diag([across, across, area * w**2 / 12.0])
    lids = [Moments(area, np.array([0.0, 0.0, sign * 0.5 * (L - w)]), lid) for sign in (1.0, -1.0)]
    return together([_tube(R, L - 2.0 * w, w), *lids])


def _capsule(R: float, l: float, w: float) -> Moments:
    """A tube and two half spheres, whose points lie l/2 farther out: ∫ (|z| + l/2)² dV."""
    r = R - w
    volume, length, square = 4.0 / 3.0 * pi * _steps(R, r, 3), pi / 2.0 * _steps(R, r, 4), 4.0 / 15.0 * pi * _steps(R, r, 5)
    caps = Moments(volume, np.zeros(3), np.diag([square, square, square + l * length + 0.25 * l**2 * volume]))
    return together([_tube(R, l, w), caps])


def _ellipsoid(a: np.ndarray, w: float) -> Moments:
    if w == 0.0:
        return _ellipsoid_surface(a)
    # Π aᵢ − Π (aᵢ − w), over w, and the same with one semi-axis cubed
    b = a - w
    volume = 4.0 / 3.0 * pi * (a[1] * a[2] + b[0] * a[2] + b[0] * b[1])
    second = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        parts = _steps(a[i], b[i], 3) * a[j] * a[k] + b[i] ** 3 * (a[k] + b[j])
        second[i] = 4.0 / 15.0 * pi * parts
    return Moments(float(volume), np.zeros(3), np.diag(second))


def _ellipsoid_surface(a: np.ndarray) -> Moments:
    """The area by Carlson's symmetric elliptic integral (DLMF 19.33.1), ∫ xᵢ² dA by quadrature, on the unit sphere u = x/a.

    There dA = a₁ a₂ a₃ √(Σ uᵢ²/aᵢ²) dΩ.
    """
    unit = a / a.max()
    x, y, z = unit**2
    area = 4.0 * pi * float(elliprg(x * y, y * z, z * x))
    volume = float(np.prod(unit))

    def integrand(phi: float, theta: float, i: int) -> float:
        u = np.array([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)])
        return np.cos(theta) * u[i] ** 2 * np.sqrt(((u / unit) ** 2).sum())

    from scipy.integrate import dblquad  # it takes a while

    octant = [dblquad(integrand, 0.0, pi / 2, 0.0, pi / 2, args=(i,), epsabs=0.0, epsrel=1e-11)[0] for i in range(3)]
    second = 8.0 * volume * unit**2 * np.array(octant)
    scale = float(a.max())
    return Moments(scale**2 * area, np.zeros(3), np.diag(scale**4 * second))
