"""A free body: position and orientation, six degrees of freedom."""

from __future__ import annotations

from articulated.dynamics.joints.ball import Ball
from articulated.dynamics.joints.joint import JointModel
from articulated.spatial import Motion, Pose, UnitMotion, Vec3
from articulated.spatial.rotation import (
    exp_translation,
    log_translation,
    rotation_of_quaternion,
)

_TURN = Ball()


class Floating(JointModel):
    """q: position in the parent [m], quaternion xyzw; v: linear, then angular velocity, in the body [m/s, rad/s]."""

    def pose(self, q) -> Pose:
        return Pose(rotation_of_quaternion(q[3:]), Vec3.of(q[:3]))

    def subspace(self, q) -> list[Motion]:
        return [UnitMotion(k) for k in (3, 4, 5, 0, 1, 2)]

    def rate(self, q, v) -> list:
        return [*(rotation_of_quaternion(q[3:]) @ Vec3.of(v[:3])), *_TURN.rate(q[3:], v[3:])]

    def integrate(self, q, dv) -> list:
        step = exp_translation(Vec3.of(dv[3:]), Vec3.of(dv[:3]))
        return [*self.pose(q).transform_point(step), *_TURN.integrate(q[3:], dv[3:])]

    def difference(self, q0, q1) -> list:
        turn = _TURN.difference(q0[3:], q1[3:])
        moved = rotation_of_quaternion(q0[3:]).transpose_times(Vec3.of(q1[:3]) - Vec3.of(q0[:3]))
        return [*log_translation(Vec3.of(turn), moved), *turn]

    def bracket(self, a, b) -> list:
        product = Motion(Vec3.of(a[3:]), Vec3.of(a[:3])).cross(Motion(Vec3.of(b[3:]), Vec3.of(b[:3])))
        return [*product.linear, *product.angular]
