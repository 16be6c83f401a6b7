"""Where body frames stand.

A joint that turns about or slides along one axis leaves two things free: how far along that axis its body's origin lies, and
how the body's frame is turned about it. They are chosen so that the placements of bodies in their parents have as many zeros
as can be: then most of what the recursions multiply by is not there.

This is the convention of Khalil and Kleinfinger (1986), Denavit and Hartenberg's with the frame at the near joint: the x axis
along the common normal to the axis of a child, the origin at its foot. A body with several children is placed for the first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_SKEW = 0.1
"""Sine of the angle between two axes below which the foot of their common normal may be far away, and is not used."""
_ROUNDING = 1e-15


def chosen_frames(parent: Sequence[int], placement: Sequence[np.ndarray], free: Sequence[bool]) -> list[np.ndarray]:
    """For each body its new frame in the old one: a shift along z and a turn about z, where the joint leaves that free.

    Args:
        parent: of each body, less than its own index; -1 is the world.
        placement: each body in its parent, shape (4, 4).
        free: whether its joint has one axis, z, along which or about which the body moves.
    """
    frames = [np.eye(4) for _ in parent]
    for i in reversed(range(len(parent))):
        if not free[i]:
            continue
        child = next((k for k, p in enumerate(parent) if p == i), None)
        if child is not None:
            X = placement[child] @ frames[child]
            shift = _foot(X) if free[child] else X[2, 3]
            tilt = np.hypot(X[0, 2], X[1, 2])
            angle = np.arctan2(X[0, 2], -X[1, 2]) if tilt > _ROUNDING else np.arctan2(X[1, 3], X[0, 3])
        else:
            X = np.linalg.inv(placement[i])
            shift = _foot(X) if parent[i] >= 0 and free[parent[i]] else X[2, 3]
            tilt = np.hypot(X[0, 2], X[1, 2])
            angle = np.arctan2(X[0, 2], -X[1, 2]) if tilt > _ROUNDING else -np.arctan2(X[1, 0], X[0, 0])
        frames[i] = _along_z(shift, angle)
    return frames


def without_rounding(x: np.ndarray, size: float) -> np.ndarray:
    """The same with what is zero but for rounding, in numbers of this size, zero."""
    return np.where(np.abs(x) <= _ROUNDING * size, 0.0, x)


def _along_z(shift: float, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, shift], [0.0, 0.0, 0.0, 1.0]])


def _foot(X: np.ndarray) -> float:
    """How far along z the common normal to another's z axis stands; level with its origin if the axes are near parallel."""
    p, axis = X[:3, 3], X[:3, 2]
    across = axis[:2] @ axis[:2]
    if across < _SKEW * _SKEW:
        return p[2]
    return p[2] - axis[2] * (p[:2] @ axis[:2]) / across
