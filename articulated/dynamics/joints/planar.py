"""A body that slides and turns in the x-y plane of its joint frame."""

from __future__ import annotations

from articulated.dynamics.joints.joint import JointModel
from articulated.scalar import Scalar, cos, sin
from articulated.spatial import Motion, Pose, UnitMotion, Vec3
from articulated.spatial.rotation import exp_translation, log_translation, rotation_about_z


class Planar(JointModel):
    """q: x, y [m] and angle [rad, unwrapped]; v: velocity in the body's own x and y [m/s], and turning rate [rad/s].

    As in Pinocchio the velocity is the body's, so that a car's first coordinate is its speed.
    """

    def pose(self, q) -> Pose:
        return Pose(rotation_about_z(q[2]), Vec3(q[0], q[1], 0.0))

    def subspace(self, q) -> list[Motion]:
        return [UnitMotion(3), UnitMotion(4), UnitMotion(2)]

    def rate(self, q, v) -> list:
        return [*_turned(q[2], v[0], v[1]), v[2]]

    def integrate(self, q, dv) -> list:
        step = exp_translation(Vec3(0.0, 0.0, dv[2]), Vec3(dv[0], dv[1], 0.0))
        dx, dy = _turned(q[2], step.x, step.y)
        return [q[0] + dx, q[1] + dy, q[2] + dv[2]]

    def difference(self, q0, q1) -> list:
        turn = q1[2] - q0[2]
        dx, dy = _turned(-q0[2], q1[0] - q0[0], q1[1] - q0[1])
        step = log_translation(Vec3(0.0, 0.0, turn), Vec3(dx, dy, 0.0))
        return [step.x, step.y, turn]

    def bracket(self, a, b) -> list:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], 0.0]


def _turned(angle: Scalar, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y
