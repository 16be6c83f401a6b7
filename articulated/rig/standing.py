"""How high a rig stands."""

from __future__ import annotations

import numpy as np

from articulated.rig.rig import Rig
from articulated.rig.shapes import Box, Capsule, Cylinder, Geometry, Mesh, Sphere


def standing_height(rig: Rig) -> float:
    """How high the root link's frame is above the lowest point of what touches the ground, all joints at zero.

        q0 = rig.neutral()
        q0[2] = art.standing_height(rig)  # of a free rig: it stands on z = 0

    Args:
        rig: any one with collision shapes; meshes do not count.

    Returns:
        Height along z [m].

    Raises:
        ValueError: no link has a collision shape other than a mesh.
    """
    X_WB: list[np.ndarray] = []
    for body in rig.bodies:
        X_WB.append((X_WB[body.parent] if body.parent >= 0 else np.eye(4)) @ body.pose)
    lowest = []
    for link in rig.links.values():
        X_WL = (X_WB[link.body] if link.body >= 0 else np.eye(4)) @ link.pose
        for shape in link.collisions:
            if not isinstance(shape.geometry, Mesh):
                X_WS = X_WL @ shape.pose
                lowest.append(X_WS[2, 3] - _reach(shape.geometry, X_WS[2, :3]))
    if not lowest:
        raise ValueError(f"rig {rig.name!r} has no collision shape to stand on; give a link a Sphere, Box, Cylinder or Capsule")
    root = next(iter(rig.links.values()))
    z = ((X_WB[root.body] if root.body >= 0 else np.eye(4)) @ root.pose)[2, 3]
    return float(z - min(lowest))


def _reach(geometry: Geometry, direction: np.ndarray) -> float:
    """How far a shape extends from its origin along a unit direction given in its own axes, or against it [m]."""
    if isinstance(geometry, Sphere):
        return geometry.radius
    if isinstance(geometry, Box):
        return float(0.5 * np.abs(direction) @ np.array(geometry.size))
    along = 0.5 * geometry.length * abs(direction[2])  # type: ignore[union-attr]
    if isinstance(geometry, Capsule):
        return along + geometry.radius
    assert isinstance(geometry, Cylinder)
    return along + geometry.radius * float(np.hypot(direction[0], direction[1]))
