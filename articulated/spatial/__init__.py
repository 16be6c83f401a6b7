"""Spatial vector algebra over scalars, after RBDA chapter 2. Inside, every spatial vector is (angular, linear)."""

from articulated.spatial.inertia import ArticulatedInertia, RigidInertia
from articulated.spatial.matrix import Mat3, Sym3
from articulated.spatial.motion import Force, Motion, UnitMotion
from articulated.spatial.pose import Pose
from articulated.spatial.turns import Turns
from articulated.spatial.vector import Vec3

__all__ = [
    "ArticulatedInertia",
    "Force",
    "Mat3",
    "Motion",
    "Pose",
    "RigidInertia",
    "Sym3",
    "Turns",
    "UnitMotion",
    "Vec3",
]
