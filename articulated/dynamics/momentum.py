"""Centre of mass and momentum of all that moves."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

from articulated.dynamics.kinematics import placements, subspaces, velocities, world_poses
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar
from articulated.spatial import Force, Pose, Vec3


def center_of_mass(mechanism: Mechanism, q: Sequence[Scalar]) -> list[Scalar]:
    """The centre of mass, in the world."""
    return list(_center(mechanism, world_poses(mechanism, placements(mechanism, q))))


def momentum(mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar]) -> list[Scalar]:
    """Linear momentum, and angular momentum about the centre of mass, in the world. RBDA 2.61, summed over bodies."""
    X = placements(mechanism, q)
    X_W = world_poses(mechanism, X)
    motion = velocities(mechanism, X, subspaces(mechanism, q), q, v)
    total = [inertia @ v_body for inertia, v_body in zip(mechanism.inertia, motion.v, strict=True)]
    at_world = Force.zero()
    for i in reversed(range(mechanism.nbodies)):
        in_parent = X[i].force_to_parent(total[i])
        if (p := mechanism.parent[i]) == WORLD:
            at_world = at_world + in_parent
        else:
            total[p] = total[p] + in_parent
    about_center = at_world.angular - _center(mechanism, X_W).cross(at_world.linear)
    return [*at_world.linear, *about_center]


def mass_moment(mechanism: Mechanism, X_W: Sequence[Pose]) -> Vec3:
    """Σ m c, in the world."""
    moments = [X.p * inertia.mass + X.R @ inertia.h for X, inertia in zip(X_W, mechanism.inertia, strict=True)]
    return reduce(lambda a, b: a + b, moments, Vec3.zero())


def _center(mechanism: Mechanism, X_W: Sequence[Pose]) -> Vec3:
    mass = sum(inertia.mass for inertia in mechanism.inertia)
    return mass_moment(mechanism, X_W) * (1.0 / mass)
