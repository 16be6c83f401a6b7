"""What is drawn of particles: lines and triangles between them, as forces tell of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from articulated.particles.forces.bending import Bending
from articulated.particles.forces.force import Force, Law
from articulated.particles.forces.pressure import TriangleWind


def segments(forces: Sequence[Force]) -> np.ndarray:
    """Pairs of particles that forces join, shape (m, 2)."""
    some = [f.particles for f in forces if isinstance(f, Law) and f.particles is not None and f.particles.shape[1] == 2]
    return np.concatenate(some) if some else np.zeros((0, 2), dtype=np.int64)


def triangles(forces: Sequence[Force]) -> np.ndarray:
    """Triangles of particles that wind blows on, or that are on both sides of a hinge, each once, shape (m, 3)."""
    some = [f.triangles for f in forces if isinstance(f, TriangleWind)]
    hinges = [f.groups for f in forces if isinstance(f, Bending) and f.groups.shape[1] == 4]
    some += [np.concatenate([h[:, [0, 1, 2]], h[:, [1, 0, 3]]]) for h in hinges]
    if not some:
        return np.zeros((0, 3), dtype=np.int64)
    every = np.concatenate(some)
    _, first = np.unique(np.sort(every, axis=1), axis=0, return_index=True)
    return every[np.sort(first)]
