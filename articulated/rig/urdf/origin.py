"""Poses as URDF gives them."""

from __future__ import annotations

import numpy as np

from articulated.rig.frames import pose_of
from articulated.rig.urdf.xml import Node


def origin_of(node: Node, tag: str = "origin") -> np.ndarray:
    """The pose, shape (4, 4), that a child with this tag gives; the identity if there is none."""
    origin = node.child(tag)
    if origin is None:
        return np.eye(4)
    quat = origin.numbers("quat_xyzw", 4) if origin.text("quat_xyzw") else None
    rpy = origin.numbers("rpy", 3) if origin.text("rpy") else None
    return pose_of(origin.place, np.array(origin.numbers("xyz", 3, (0.0, 0.0, 0.0))), rpy, quat)
