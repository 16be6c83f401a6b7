"""Frames of a file that are missing: filled from the frames around them, the shortest way that a joint can turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from articulated.characters.document import Document
from articulated.rig.errors import Place


def whole(document: Document, repair: bool) -> Document:
    """A file of two frames at least, without gaps: frames that hold NaN or infinite numbers.

    Args:
        document: the file.
        repair: fill them, with a warning that names them.

    Raises:
        RigError: there are gaps, and no repair is wanted, or possible; or there is but one frame.
    """
    place = Place(document.source)
    if len(document.values) < 2:
        raise place.error("there is one frame", "a motion takes two at least")
    bad = ~np.isfinite(document.values)
    if not bad.any():
        return document
    frame, column = (int(k) for k in np.argwhere(bad)[0])
    gaps = np.flatnonzero(bad.any(axis=1))
    here = Place(document.source, f"frame {frame}", document.lines[frame])
    if not repair:
        what = next(f"{j.name!r} {name}" for j in document.joints for name, at in document.columns(j).items() if at == column)
        raise here.error(f"{what} is {document.values[frame, column]}", "mend it, or fill such gaps with repair=True")
    if len(gaps) > len(bad) - 2:
        raise here.error(f"{len(gaps)} of {len(bad)} frames are gaps", "two whole frames are needed at least")
    place.warn(f"{numbered(gaps)} held numbers that are not finite", "filled from those before and after")
    return replace(document, values=_filled(document, gaps))


def _filled(document: Document, gaps: np.ndarray) -> np.ndarray:
    values, good = document.values.copy(), np.setdiff1d(np.arange(len(document.values)), gaps)
    for joint in document.joints:
        at = document.columns(joint)
        for name, column in at.items():
            if name.endswith("position"):
                values[gaps, column] = np.interp(gaps, good, values[good, column])
        turning = [(k, at[f"{axis}rotation"]) for k, axis in enumerate(joint.order) if f"{axis}rotation" in at]
        angles = np.zeros((len(good), 3))
        for k, column in turning:
            angles[:, k] = values[good, column]
        between = turned(Rotation.from_euler(joint.order, angles, degrees=True), good, gaps)
        filled = between.as_euler(joint.order, degrees=True)
        for k, column in turning:
            values[gaps, column] = filled[:, k]
    return values


def turned(turns: Rotation, frames: np.ndarray, gaps: np.ndarray) -> Rotation:
    """Turns in gaps between those of these frames; before the first and after the last, theirs."""
    return Slerp(frames, turns)(np.clip(gaps, frames[0], frames[-1]))


def numbered(frames: np.ndarray) -> str:
    """Numbers of frames in few words: "frames 3, 7-12"."""
    starts = np.flatnonzero(np.diff(frames, prepend=-2) != 1).tolist()
    parts = []
    for start, stop in zip(starts, [*starts[1:], len(frames)], strict=True):
        first, last = int(frames[start]), int(frames[stop - 1])
        parts.append(f"{first}" if first == last else f"{first}-{last}")
    return f"frame{'s' if len(frames) > 1 else ''} {', '.join(parts[:8])}{', …' if len(parts) > 8 else ''}"
