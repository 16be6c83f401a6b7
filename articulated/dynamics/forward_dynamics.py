"""Forward dynamics: the articulated-body algorithm, RBDA table 7.1, p. 132. O(n) in the number of bodies.

symbol   meaning                                            RBDA
X, S, v, c                                                  see `kinematics`
IA, pA   articulated-body inertia and bias force            7.21, 7.24
U, D, u  IA S,  Sᵀ U + armature,  τ − Sᵀ pA                 7.43–7.45
a        acceleration of points, −gravity at the root       7.50

Differs: a joint of several coordinates gives them up one after the other, which is an unrolled LDLᵀ of its D (see
`elimination`); bodies count from 0 and the world is -1.
"""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.elimination import Elimination, merged
from articulated.dynamics.kinematics import (
    external_forces,
    gravity_acceleration,
    placements,
    subspaces,
    velocities,
)
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar
from articulated.spatial import Force, Motion


def forward_dynamics(
    mechanism: Mechanism,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    tau: Sequence[Scalar],
    gravity: Sequence[Scalar],
    external: Sequence[Sequence[Scalar]] | None = None,
    on_bodies: Sequence[Force | None] | None = None,
) -> list[Scalar]:
    """Generalized accelerations.

    `external` has wrenches on links, (linear, angular) in the world at their origins; `on_bodies` forces in bodies' own axes.
    """
    armature = mechanism.armature
    X, S = placements(mechanism, q), subspaces(mechanism, q)
    motion = velocities(mechanism, X, S, q, v)
    f_external = external_forces(mechanism, X, external)
    for i, f in enumerate(on_bodies or ()):
        if f is not None:
            f_external[i] = f if (so_far := f_external[i]) is None else so_far + f

    # outward: what each body would do alone
    IA = [inertia.articulated() for inertia in mechanism.inertia]
    pA = []
    for i, inertia in enumerate(mechanism.inertia):
        p_body = inertia.gyroscopic(motion.v[i].angular)
        pA.append(p_body if (given := f_external[i]) is None else p_body - given)

    # inward: fold each subtree into its parent, its joint free
    eliminations: list[Elimination] = [Elimination.none()] * mechanism.nbodies
    open_above = {i: [] for i in range(WORLD, mechanism.nbodies)}
    for i in reversed(range(mechanism.nbodies)):
        joint = mechanism.joints[i]
        e = eliminations[i] = Elimination.begin(merged(open_above[i]), IA[i], pA[i])
        e.open_joint(S[i], joint.v, tau, armature, follows=joint.follows)
        e.close(mechanism.closes[i])
        if (p := mechanism.parent[i]) != WORLD:
            IA[p] = IA[p] + X[i].articulated_to_parent(e.IA)
            pA[p] = pA[p] + X[i].force_to_parent(e.pA + e.IA @ motion.c[i])
        open_above[p].append(e.carried_to_parent(X[i], motion.c[i]))
    world = Elimination.begin(merged(open_above[WORLD]))
    world.close(mechanism.closes[WORLD])

    # outward: accelerations
    qdd: list[Scalar] = [0.0] * mechanism.nv
    a_world = gravity_acceleration(gravity)
    world.solve(a_world, qdd)
    a: list[Motion] = []
    for i, e in enumerate(eliminations):
        p = mechanism.parent[i]
        a_body = X[i].motion_to_child(a_world if p == WORLD else a[p]) + motion.c[i]
        e.solve(a_body, qdd)
        for column, s in zip(S[i], mechanism.joints[i].v, strict=True):
            a_body = a_body + column * qdd[s]
        a.append(a_body)
    return qdd
