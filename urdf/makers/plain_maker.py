"""Links that are one solid shape, each with its own few lines of moments.

Rigs made with this came before `art.mass_properties`, and tests were tuned on their every digit: new ones use `maker`.
"""

from __future__ import annotations

import math

import numpy as np

import articulated as art


def at(xyz=(0.0, 0.0, 0.0), along=(0.0, 0.0, 1.0)) -> np.ndarray:
    """A pose at a point with z along a coordinate direction."""
    pose = np.eye(4)
    z = np.array(along, dtype=float)
    x = np.roll(z, 1)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = xyz
    return pose


def box_inertia(mass: float, size) -> np.ndarray:
    x, y, z = (s * s for s in size)
    return np.diag([y + z, x + z, x + y]) * mass / 12.0


def round_inertia(mass: float, radius: float, length: float, capped: bool) -> np.ndarray:
    """Of a solid cylinder along z, or of a capsule."""
    ball = 4.0 / 3.0 * math.pi * radius**3 if capped else 0.0
    tube = math.pi * radius**2 * length
    m_ball, m_tube = mass * ball / (ball + tube), mass * tube / (ball + tube)
    # a half ball's centre is 3/8 of the radius beyond the end of the tube
    across = m_tube * (length**2 / 12 + radius**2 / 4)
    across += m_ball * (0.4 * radius**2 + length**2 / 4 + 0.375 * length * radius)
    about = m_tube * radius**2 / 2 + m_ball * 0.4 * radius**2
    return np.diag([across, across, about])


class PlainMaker(art.RigBuilder):
    """Adds links that are one solid shape."""

    def box(self, name: str, mass: float, size, center=(0.0, 0.0, 0.0)) -> None:
        shape = art.Shape(art.Box(tuple(size)), at(center))
        self.link(name, mass, center, box_inertia(mass, size), [shape], [shape])

    def round(self, name: str, mass: float, geometry, center=(0.0, 0.0, 0.0), along=(0.0, 0.0, 1.0)) -> None:
        shape = art.Shape(geometry, at(center, along))
        R = shape.pose[:3, :3]
        inertia = R @ round_inertia(mass, geometry.radius, geometry.length, isinstance(geometry, art.Capsule)) @ R.T
        self.link(name, mass, center, inertia, [shape], [shape])
