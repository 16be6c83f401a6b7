"""A ball joint: any rotation, as a unit quaternion, so that no configuration is singular."""

from __future__ import annotations

from articulated.dynamics.joints.joint import JointModel
from articulated.spatial import Motion, Pose, UnitMotion, Vec3
from articulated.spatial.rotation import (
    quaternion_conjugate,
    quaternion_exp,
    quaternion_log,
    quaternion_normalized,
    quaternion_product,
    rotation_of_quaternion,
)


class Ball(JointModel):
    """q: quaternion xyzw, body to joint frame; v: angular velocity in the body [rad/s]. RBDA table 4.1, spherical."""

    def pose(self, q) -> Pose:
        return Pose(rotation_of_quaternion(q), Vec3.zero())

    def subspace(self, q) -> list[Motion]:
        return [UnitMotion(0), UnitMotion(1), UnitMotion(2)]

    def rate(self, q, v) -> list:
        return [0.5 * x for x in quaternion_product(q, [*v, 0.0])]

    def integrate(self, q, dv) -> list:
        # normalised because rounding, step after step, would let the norm wander
        return quaternion_normalized(quaternion_product(q, quaternion_exp(Vec3.of(dv))))

    def difference(self, q0, q1) -> list:
        return list(quaternion_log(quaternion_product(quaternion_conjugate(q0), q1)))

    def bracket(self, a, b) -> list:
        return list(Vec3.of(a).cross(Vec3.of(b)))
