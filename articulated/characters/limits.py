"""Limits of ball joints from what they have been seen to do."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.swing_twist import tilt_and_twist
from articulated.rig import SwingTwist


def fit_swing_twist(
    quat_xyzw: ArrayLike,
    axis: Sequence[float] = (0.0, 0.0, 1.0),
    toward: Sequence[float] = (1.0, 0.0, 0.0),
    margin: float = math.radians(10.0),
) -> SwingTwist:
    """The narrowest cone and range of twist that hold all configurations of a ball joint, and a margin.

    Args:
        quat_xyzw: its configurations, shape (..., 4).
        axis, toward: of the limits; see `SwingTwist`.
        margin: added on all sides [rad].

    Raises:
        ValueError: there are none, one is not finite or no unit quaternion, or the margin is negative.
    """
    q = np.asarray(quat_xyzw, dtype=float)
    if q.ndim == 0 or q.shape[-1] != 4 or not q.size:
        raise ValueError(f"quat_xyzw has shape {q.shape}; expected (..., 4), one at least")
    if not np.isfinite(q).all() or np.abs(np.linalg.norm(q, axis=-1) - 1.0).max() > 1e-6:
        raise ValueError("quat_xyzw holds what is no unit quaternion; normalise them")
    if not 0.0 <= margin < math.inf:
        raise ValueError(f"margin is {margin!r}; expected radians, zero or more")
    q = q.reshape(-1, 4)
    frame = SwingTwist(tuple(axis), tuple(toward))  # type: ignore[arg-type]
    *tilt, twist = (np.asarray(x) for x in tilt_and_twist(frame, list(q.T)))
    ends = np.array([(max(t.max(), 0.0), max(-t.min(), 0.0)) for t in tilt])
    half = np.array([np.where(t > 0.0, e[0], e[1]) for t, e in zip(tilt, ends, strict=True)])
    with np.errstate(divide="ignore", invalid="ignore"):
        F = np.nansum(np.where(half > 1e-9, (np.array(tilt) / half) ** 2, 0.0), axis=0)
    ends = np.minimum(ends * math.sqrt(max(float(F.max()), 1.0)) + margin, math.pi)
    lower, upper = _arc(twist)
    spread = min(upper - lower + 2.0 * margin, 2.0 * math.pi)
    middle = 0.5 * (lower + upper)
    swing = (ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])
    return SwingTwist(frame.axis, frame.toward, swing, (middle - 0.5 * spread, middle + 0.5 * spread))


def _arc(angles: np.ndarray) -> tuple[float, float]:
    """The shortest arc that holds some angles: what is left beside their widest gap."""
    some = np.sort(np.mod(angles, 2.0 * math.pi))
    gaps = np.diff(np.append(some, some[0] + 2.0 * math.pi))
    k = int(np.argmax(gaps))
    start = float(some[(k + 1) % len(some)])
    length = 2.0 * math.pi - float(gaps[k])
    middle = math.remainder(start + 0.5 * length, 2.0 * math.pi)
    return middle - 0.5 * length, middle + 0.5 * length
