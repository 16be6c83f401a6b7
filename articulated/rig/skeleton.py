"""The skeleton of a BVH file: what a motion needs to be written as it was read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Bone:
    """A joint of the file.

    Attributes:
        name: its name, and that of the rig's link.
        parent: number of the joint that it hangs from, or -1.
        offset: from there, in the file's axes and unit.
        order: in which it turns about its axes, such as "ZYX".
        ends: offsets of its end sites.
    """

    name: str
    parent: int
    offset: tuple[float, float, float]
    order: str
    ends: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Skeleton:
    """All of them, parents first.

    Attributes:
        bones: its joints; the first is the root, which has a position too.
        scale: metres in a unit of the file.
        turn: from the file's axes to the world's, shape (3, 3).
        channels: in which order the root's position stands, such as "XYZ".
    """

    bones: tuple[Bone, ...]
    scale: float
    turn: np.ndarray
    channels: str = "XYZ"
