"""Kinetic and potential energy of all that moves."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.kinematics import placements, subspaces, velocities, world_poses
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.momentum import mass_moment
from articulated.scalar import Scalar
from articulated.spatial import Vec3


def kinetic_energy(mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar]) -> Scalar:
    """½ Σ vᵀ I v over bodies, RBDA 2.67, and ½ armature q̇² over joints: ½ vᵀ M v."""
    motion = velocities(mechanism, placements(mechanism, q), subspaces(mechanism, q), q, v)
    twice: Scalar = 0.0
    for inertia, v_body in zip(mechanism.inertia, motion.v, strict=True):
        twice = twice + v_body.dot(inertia @ v_body)
    for armature, x in zip(mechanism.armature, v, strict=True):
        twice = twice + armature * x * x
    return 0.5 * twice


def potential_energy(mechanism: Mechanism, q: Sequence[Scalar], gravity: Sequence[Scalar]) -> Scalar:
    """−Σ m g·c, zero where all mass is at the world's origin."""
    X_W = world_poses(mechanism, placements(mechanism, q))
    return -mass_moment(mechanism, X_W).dot(Vec3.of(gravity))
