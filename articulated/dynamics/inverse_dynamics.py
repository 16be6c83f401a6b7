"""Inverse dynamics: the recursive Newton-Euler algorithm, RBDA table 5.1, p. 96. O(n) in the number of bodies.

symbol   meaning                                            RBDA
X, S, v, c                                                  see `kinematics`
a        acceleration of points, −gravity at the root       5.8
f        force across the body's joint                      5.9, 5.10
tau      Sᵀ f + armature q̈                                  5.11
"""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.kinematics import (
    combination,
    external_forces,
    gravity_acceleration,
    placements,
    subspaces,
    velocities,
)
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar
from articulated.spatial import Force, Motion


def inverse_dynamics(
    mechanism: Mechanism,
    q: Sequence[Scalar],
    v: Sequence[Scalar] | None,
    a: Sequence[Scalar] | None,
    gravity: Sequence[Scalar],
    external: Sequence[Sequence[Scalar]] | None = None,
) -> list[Scalar]:
    """The generalized forces that give the acceleration a; None for v or a means zero, and leaves out its terms."""
    X, S = placements(mechanism, q), subspaces(mechanism, q)
    motion = velocities(mechanism, X, S, q, v) if v is not None else None
    f_external = external_forces(mechanism, X, external)

    # outward: accelerations, and the force that each body needs
    acceleration: list[Motion] = []
    f: list[Force] = []
    for i, joint in enumerate(mechanism.joints):
        p = mechanism.parent[i]
        a_body = X[i].motion_to_child(gravity_acceleration(gravity) if p == WORLD else acceleration[p])
        if a is not None:
            a_body = a_body + combination(S[i], [a[k] for k in joint.v])
        if motion is not None:
            a_body = a_body + motion.c[i]
        needed = mechanism.inertia[i] @ a_body
        if motion is not None:
            needed = needed + mechanism.inertia[i].gyroscopic(motion.v[i].angular)
        if (given := f_external[i]) is not None:
            needed = needed - given
        acceleration.append(a_body)
        f.append(needed)

    # inward: hand forces down the tree, read off each joint's share
    tau: list[Scalar] = [0.0] * mechanism.nv
    for i in reversed(range(mechanism.nbodies)):
        for column, s in zip(S[i], mechanism.joints[i].v, strict=True):
            tau[s] = tau[s] + column.dot(f[i])
        if (p := mechanism.parent[i]) != WORLD:
            f[p] = f[p] + X[i].force_to_parent(f[i])
    if a is not None:
        tau = [t + armature * x for t, armature, x in zip(tau, mechanism.armature, a, strict=True)]
    return tau
