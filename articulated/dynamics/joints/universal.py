"""A universal joint: a turn about an axis of the parent, then one about the body's z axis."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.joints.joint import JointModel
from articulated.spatial import Motion, Pose, UnitMotion, Vec3
from articulated.spatial.rotation import rotation_about, rotation_about_z


class Universal(JointModel):
    """q: the two angles [rad]; v: their rates. Two axes that are not parallel have no singularity."""

    def __init__(self, first_axis: Sequence[float]):
        """`first_axis` is a unit vector in the joint frame; the second axis is z."""
        self.first_axis = Vec3.of([float(x) for x in first_axis])

    def pose(self, q) -> Pose:
        return Pose(rotation_about(self.first_axis, q[0]) @ rotation_about_z(q[1]), Vec3.zero())

    def subspace(self, q) -> list[Motion]:
        return [Motion(self._first_axis_in_body(q), Vec3.zero()), UnitMotion(2)]

    def velocity_product(self, q, v) -> Motion:
        # the first axis turns backwards, as seen from a body that turns about z
        spin = Vec3(0.0, 0.0, v[1])
        return Motion(self._first_axis_in_body(q).cross(spin) * v[0], Vec3.zero())

    def _first_axis_in_body(self, q) -> Vec3:
        return rotation_about_z(q[1]).transpose_times(self.first_axis)
