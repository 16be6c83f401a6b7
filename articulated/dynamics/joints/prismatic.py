"""A slide along the body's z axis."""

from __future__ import annotations

from articulated.dynamics.joints.joint import JointModel
from articulated.spatial import Motion, Pose, Turns, UnitMotion, Vec3


class Prismatic(JointModel):
    """q: displacement [m]; v: its rate. RBDA table 4.1, second row."""

    def pose(self, q) -> Pose:
        return Pose(Turns([]), Vec3(0.0, 0.0, q[0]))

    def subspace(self, q) -> list[Motion]:
        return [UnitMotion(5)]
