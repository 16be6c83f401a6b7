"""Configurations between those of frames, on the configuration manifold."""

from __future__ import annotations

import numpy as np

from articulated.dynamics.functions import difference, integrate
from articulated.rig import Rig


def rates(rig: Rig, q: np.ndarray, dt: float) -> np.ndarray:
    """Velocities of frames that are dt apart, by central differences, one-sided at the ends: (T, nq) to (T, nv)."""
    steps = difference(rig, q[:-1], q[1:]) / dt
    v = np.empty((len(q), rig.nv))
    v[1:-1], v[0], v[-1] = 0.5 * (steps[:-1] + steps[1:]), steps[0], steps[-1]
    if len(q) > 2:  # parabolas through three frames
        v[0], v[-1] = 1.5 * steps[0] - 0.5 * steps[1], 1.5 * steps[-1] - 0.5 * steps[-2]
    return v


def between(rig: Rig, q: np.ndarray, v: np.ndarray, dt: float, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Configurations and velocities at places between frames: cubics from frame to frame, exact at each.

    Hermite's, in the coordinates of `difference` at the frame before: velocities are smooth up to the square of a step's turn.

    Args:
        rig: the rig.
        q, v: of frames, shapes (T, nq) and (T, nv).
        dt: between frames [s].
        place: in frames, from 0 to T − 1, shape (...).
    """
    k = np.clip(np.floor(place).astype(int), 0, len(q) - 2)
    s = (place - k)[..., None]
    d, a, b = difference(rig, q[k], q[k + 1]), dt * v[k], dt * v[k + 1]
    x = s * (a + s * (3.0 * d - 2.0 * a - b + s * (a + b - 2.0 * d)))
    rate = a + s * (2.0 * (3.0 * d - 2.0 * a - b) + s * 3.0 * (a + b - 2.0 * d))
    return integrate(rig, q[k], x), rate / dt
