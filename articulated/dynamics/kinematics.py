"""Where bodies are and how they move: the outward pass that every recursion begins with, RBDA 4.5 and table 5.1.

symbol   meaning                                                    RBDA
X        X_PB, pose of the body in its parent                       4.3
S        motion of the body for each coordinate of its joint        3.33
v        velocity of the body, in the body                          5.7
c        velocity-product acceleration                              7.3

Differs: accelerations are those of points, as on a stopwatch, where RBDA's spatial ones are the change of a field (2.11): the
linear part is ω × v larger. So the dynamics need no linear velocities, and c is what a point at the body's origin feels:
ω_P × (ω_P × p) from its parent's turning, and Coriolis' (ω_P + ω) × v_J if its joint slides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar
from articulated.spatial import Force, Motion, Pose, Vec3


@dataclass(frozen=True, eq=False)
class Velocities:
    """The velocity `v` and the velocity-product acceleration `c` of each body, in the body."""

    v: list[Motion]
    c: list[Motion]


def placements(mechanism: Mechanism, q: Sequence[Scalar]) -> list[Pose]:
    """`X_PB` of each body."""
    return [
        X_PJ @ joint.model.pose(joint.configuration(q))
        for X_PJ, joint in zip(mechanism.placement, mechanism.joints, strict=True)
    ]


def subspaces(mechanism: Mechanism, q: Sequence[Scalar]) -> list[list[Motion]]:
    """S of each body's joint, one column for each coordinate that moves it."""
    return [joint.subspace(q) for joint in mechanism.joints]


def velocities(
    mechanism: Mechanism, X: Sequence[Pose], S: Sequence[Sequence[Motion]], q: Sequence[Scalar], v: Sequence[Scalar]
) -> Velocities:
    """Velocities and velocity products of all bodies."""
    result = Velocities([], [])
    for i, joint in enumerate(mechanism.joints):
        v_body = v_joint = combination(S[i], [v[k] for k in joint.v])
        c = Motion(Vec3.zero(), v_joint.angular.cross(v_joint.linear))
        if (p := mechanism.parent[i]) != WORLD:
            v_parent = X[i].motion_to_child(result.v[p])
            v_body = v_parent + v_joint
            carried = X[i].R.transpose_times(result.v[p].angular.cross_twice(X[i].p))
            coriolis = (v_parent.angular + v_body.angular).cross(v_joint.linear)
            c = Motion(v_body.angular.cross(v_joint.angular), carried + coriolis)
        if (c_joint := joint.model.velocity_product(joint.configuration(q), joint.velocity(v))) is not None:
            c = c + c_joint
        result.v.append(v_body)
        result.c.append(c)
    return result


def combination(S: Sequence[Motion], coefficients: Sequence[Scalar]) -> Motion:
    """Σ S_k x_k."""
    return reduce(lambda a, b: a + b, (column * x for column, x in zip(S, coefficients, strict=True)))


def world_poses(mechanism: Mechanism, X: Sequence[Pose]) -> list[Pose]:
    """`X_WB` of each body, their rotations as matrices."""
    poses: list[Pose] = []
    for i, p in enumerate(mechanism.parent):
        poses.append((Pose.identity() if p == WORLD else poses[p]) @ X[i])
    return poses


def gravity_acceleration(gravity: Sequence[Scalar]) -> Motion:
    """The acceleration of a world in which weight is felt as inertia: −gravity, RBDA 5.3."""
    return Motion(Vec3.zero(), -Vec3.of(gravity))


def external_forces(mechanism: Mechanism, X: Sequence[Pose], external: Sequence[Sequence[Scalar]] | None) -> list[Force | None]:
    """For each body, the sum of the wrenches on its links, in the body; None where there is none.

    Args:
        external: a wrench for each link, (linear, angular), in the world at the link origin; None for none at all.
    """
    forces: list[Force | None] = [None] * mechanism.nbodies
    if external is None:
        return forces
    X_W = world_poses(mechanism, X)
    for (body, X_BL), wrench in zip(mechanism.links, external, strict=True):
        if body == WORLD:
            continue
        linear = X_W[body].R.transpose_times(Vec3.of(wrench[:3]))
        angular = X_W[body].R.transpose_times(Vec3.of(wrench[3:]))
        force = Force(angular + X_BL.p.cross(linear), linear)
        so_far = forces[body]
        forces[body] = force if so_far is None else so_far + force
    return forces


def link_poses(mechanism: Mechanism, q: Sequence[Scalar]) -> list[list[list[Scalar]]]:
    """`X_WL` of each link as a homogeneous matrix."""
    X_W = world_poses(mechanism, placements(mechanism, q))
    matrices = []
    for body, X_BL in mechanism.links:
        X_WL = (Pose.identity() if body == WORLD else X_W[body]) @ X_BL
        matrices.append(X_WL.matrix())
    return matrices


def link_velocities(mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar]) -> list[list[Scalar]]:
    """Velocity of each link at its origin, (linear, angular), in the world."""
    X = placements(mechanism, q)
    X_W = world_poses(mechanism, X)
    motions = velocities(mechanism, X, subspaces(mechanism, q), q, v).v
    result = []
    for body, X_BL in mechanism.links:
        if body == WORLD:
            result.append([0.0] * 6)
            continue
        at_link = motions[body].linear + motions[body].angular.cross(X_BL.p)
        result.append([*(X_W[body].R @ at_link), *(X_W[body].R @ motions[body].angular)])
    return result


def point_wrench(
    mechanism: Mechanism,
    q: Sequence[Scalar],
    force: Sequence[Scalar],
    point: Sequence[Scalar] | None,
    couple: Sequence[Scalar],
    link: int,
) -> list[list[Scalar]]:
    """Wrenches on all links, (linear, angular) in the world at the link origins, zero but for a force at a point of one."""
    wrenches: list[list[Scalar]] = [[0.0] * 6 for _ in mechanism.links]
    angular = Vec3.of(couple)
    if point is not None:
        body, X_BL = mechanism.links[link]
        X_W = world_poses(mechanism, placements(mechanism, q))
        R_WL = X_BL.R if body == WORLD else X_W[body].R @ X_BL.R
        angular = angular + (R_WL @ Vec3.of(point)).cross(Vec3.of(force))
    wrenches[link] = [*force, *angular]
    return wrenches
