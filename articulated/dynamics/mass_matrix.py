"""The mass matrix by the composite-rigid-body algorithm, RBDA table 6.2, p. 108. O(n d) for a tree of depth d.

symbol   meaning                                            RBDA
Ic       inertia of a body and all that hangs from it       6.13
F        force that carries them along one coordinate       6.14
"""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.kinematics import placements, subspaces
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar


def mass_matrix(mechanism: Mechanism, q: Sequence[Scalar]) -> list[list[Scalar]]:
    """M, full and symmetric, armature included. Where two coordinates never meet it holds the constant 0."""
    X, S = placements(mechanism, q), subspaces(mechanism, q)

    # inward: composite inertias
    Ic = list(mechanism.inertia)
    for i in reversed(range(mechanism.nbodies)):
        if (p := mechanism.parent[i]) != WORLD:
            Ic[p] = Ic[p] + X[i].rigid_to_parent(Ic[i])

    # each coordinate's force, carried down to the root past every joint that bears it
    M: list[list[Scalar]] = [[0.0] * mechanism.nv for _ in range(mechanism.nv)]
    for i, joint in enumerate(mechanism.joints):
        for k, s in enumerate(joint.v):
            F = Ic[i] @ S[i][k]
            for other, t in zip(S[i][k:], joint.v[k:], strict=True):
                _add(M, s, t, other.dot(F), twice=False)
            below = i
            while (p := mechanism.parent[below]) != WORLD:
                F = X[below].force_to_parent(F)
                for other, t in zip(S[p], mechanism.joints[p].v, strict=True):
                    _add(M, s, t, other.dot(F), twice=True)
                below = p
    for s, armature in enumerate(mechanism.armature):
        M[s][s] = M[s][s] + armature
    return M


def _add(M: list[list[Scalar]], s: int, t: int, x: Scalar, twice: bool) -> None:
    """Add x to M_st and M_ts; to M_ss twice, if it is two different joints that share the coordinate."""
    if s == t:
        M[s][s] = M[s][s] + (x + x if twice else x)
    else:
        M[s][t] = M[t][s] = M[s][t] + x
