"""A hinge about the body's z axis; also the continuous joint, whose one angle is unwrapped."""

from __future__ import annotations

from articulated.dynamics.joints.joint import JointModel
from articulated.spatial import Motion, Pose, UnitMotion, Vec3
from articulated.spatial.rotation import rotation_about_z


class Revolute(JointModel):
    """q: angle [rad]; v: its rate. RBDA table 4.1, first row."""

    def pose(self, q) -> Pose:
        return Pose(rotation_about_z(q[0]), Vec3.zero())

    def subspace(self, q) -> list[Motion]:
        return [UnitMotion(2)]
