"""Joints that flip for some frames and come back, made to go on as they did."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from articulated.characters.gaps import numbered
from articulated.dynamics.functions import difference, integrate
from articulated.rig import Joint, Rig
from articulated.rig.errors import Place
from articulated.trajectory import Motion

FAST = 30.0
"""A joint that moves faster from one frame to the next jumps [rad/s or m/s]; as in `audit`."""


def repaired(motion: Motion, *, fast: float = FAST, longest: float = 0.1) -> Motion:
    """The same motion without flips: frames between a jump of a joint and its jump back, if they are few.

    Such a joint goes the shortest way from the frame before to the frame after; what is flipped at the beginning or the end
    stands as the next frame has it: some clips begin with a frame at rest. Other joints keep what they do.

    Args:
        motion: with or without flips.
        fast: a joint that moves faster jumps [rad/s or m/s].
        longest: flips that last longer are left [s].

    Returns:
        The motion. A `RigWarning` names the joints and frames that were changed, and jumps that are left.

    Raises:
        ValueError: fast or longest is not a positive number.
    """
    for name, value, unit in (("fast", fast, "radians or metres a second"), ("longest", longest, "seconds")):
        if not isinstance(value, (int, float, np.number)) or not 0.0 < value < math.inf:
            raise ValueError(f"{name} is {value!r}; expected a positive number of {unit}")
    rig, q = motion.rig, motion.q.copy()
    frames = int(longest * motion.fps + 1e-9)
    for joint in rig.joints.values():
        if joint.mimic:
            continue
        place = Place(f"motion {motion.name or rig.name!r}", f"joint {joint.name!r}")
        if (bad := _flipped(rig, joint, q, fast / motion.fps, frames)).any():
            q[:, joint.q_slice] = _bridged(rig, q, bad)[:, joint.q_slice]
            place.warn(f"was flipped in {numbered(np.flatnonzero(bad))}", "goes there from the frame before to that after")
        if (left := np.flatnonzero(_steps(rig, joint, q) > fast / motion.fps)).size:
            place.warn(f"jumps after {numbered(left)}, and not back within {longest:g} s", "left: cut the motion there")
    return replace(motion, q=q)


def _steps(rig: Rig, joint: Joint, q: np.ndarray) -> np.ndarray:
    """How far a joint moves from each frame to the next, shape (T - 1,); its turn, if it turns."""
    moved = difference(rig, q[:-1], q[1:])[:, joint.v_slice]
    return np.linalg.norm(moved[:, 3:] if joint.kind == "floating" else moved, axis=-1)


def _flipped(rig: Rig, joint: Joint, q: np.ndarray, far: float, longest: int) -> np.ndarray:
    """The frames of short runs between jumps, after and before which the joint does not seem to have jumped; shape (T,)."""
    bad = np.zeros(len(q), dtype=bool)
    cuts = np.flatnonzero(_steps(rig, joint, q) > far) + 1
    if not cuts.size:
        return bad
    runs = list(zip([0, *cuts.tolist()], [*cuts.tolist(), len(q)], strict=True))
    good = [(start, stop) for start, stop in runs if stop - start > longest]
    for start, stop in runs:
        if stop - start > longest:
            continue
        before = [b for _, b in good if b <= start]
        after = [a for a, _ in good if a >= stop]
        if before and after:
            ends = q[[before[-1] - 1, after[0]]]
            bad[start:stop] = _steps(rig, joint, ends)[0] < far * (after[0] - before[-1] + 1)
        else:
            bad[start:stop] = bool(before or after)
    return bad


def _bridged(rig: Rig, q: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Every joint in bad frames between the good ones beside them."""
    good = np.flatnonzero(~bad)
    frames = np.arange(len(q))
    right = good[np.minimum(np.searchsorted(good, frames), len(good) - 1)]
    left = good[np.maximum(np.searchsorted(good, frames, side="right") - 1, 0)]
    left, right = np.where(left > frames, right, left), np.where(right < frames, left, right)
    part = (frames - left) / np.maximum(right - left, 1)
    return integrate(rig, q[left], np.clip(part, 0.0, 1.0)[:, None] * difference(rig, q[left], q[right]))
