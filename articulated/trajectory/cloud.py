"""Recorded particles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Cloud:
    """Frames of particles, of one state or of a batch whose axes lead.

    Attributes:
        x: positions in the world, shape (..., T, n, 3) [m].
        v: velocities, shape (..., T, n, 3) [m/s].
        segments: pairs of particles that something joins, to be drawn, shape (m, 2).
        triangles: between which there is cloth, shape (k, 3).
    """

    x: np.ndarray
    v: np.ndarray
    segments: np.ndarray
    triangles: np.ndarray

    def state(self, *index: int) -> Cloud:
        """Of one state of a batch, or of part of a batch."""
        return replace(self, x=np.asarray(self.x[index]), v=np.asarray(self.v[index]))
