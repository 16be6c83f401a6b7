"""How high a motion is above the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from articulated.dynamics.functions import link_poses
from articulated.rig import Box, Capsule, Cylinder, Rig, Sphere
from articulated.trajectory import Motion


def lowest(rig: Rig, q: np.ndarray) -> np.ndarray:
    """How high the lowest point of each link's plain collision shapes is, shape (..., nlinks) [m]; infinite if it has none."""
    X, result = link_poses(rig, q), np.full((*np.shape(q)[:-1], rig.nlinks), np.inf)
    for link in rig.links.values():
        for shape in link.collisions:
            pose, what = X[..., link.index, :, :] @ shape.pose, shape.geometry
            z, along = pose[..., 2, 3], np.abs(pose[..., 2, 2])
            if isinstance(what, Sphere):
                reach = what.radius
            elif isinstance(what, Box):
                reach = 0.5 * np.abs(pose[..., 2, :3]) @ np.array(what.size)
            elif isinstance(what, Capsule):
                reach = what.radius + 0.5 * what.length * along
            elif isinstance(what, Cylinder):
                reach = 0.5 * what.length * along + what.radius * np.sqrt(np.maximum(1.0 - along * along, 0.0))
            else:
                continue
            result[..., link.index] = np.minimum(result[..., link.index], z - reach)
    return result


def grounded(motion: Motion, part: float = 0.0) -> Motion:
    """The same motion so high that its shapes touch the plane z = 0 but do not enter it.

    Args:
        motion: of a rig with a free root, or one that hangs by links with plain collision shapes.
        part: of the frames that may, the lowest: what is there by mistake.

    Raises:
        ValueError: the root cannot be moved, there are no such shapes, or the part is none.
    """
    rig = motion.rig
    root = next((joint for joint in rig.joints.values() if joint.kind == "floating" and rig.is_root(joint)), None)
    if root is None:
        raise ValueError(f"rig {rig.name!r} has no free root that could be raised; load it with root='free'")
    if not 0.0 <= part < 1.0:
        raise ValueError(f"part is {part!r}; expected a part of the frames, from 0 to less than 1")
    low = lowest(rig, motion.q).min(axis=-1)
    if not np.isfinite(low).all():
        raise ValueError(f"rig {rig.name!r} has no sphere, box, capsule or cylinder that could touch the ground")
    q = motion.q.copy()
    q[:, root.q_slice.start + 2] -= np.quantile(low, part)
    return replace(motion, q=q)
