"""A particle as laws of force see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from articulated.scalar import Scalar
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class Point:
    """A particle, over scalars.

    Attributes:
        x: where it is, in the world [m].
        v: its velocity [m/s].
        m: its mass [kg].
    """

    x: Vec3
    v: Vec3
    m: Scalar


def vectors(rows: np.ndarray) -> Vec3:
    """Rows of three numbers as one vector of arrays."""
    return Vec3(rows[:, 0], rows[:, 1], rows[:, 2])
