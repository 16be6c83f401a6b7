"""Whether every joint of a rig moves some mass: only then is its mass matrix positive definite.

A body's idle motions, a subspace of the six dimensions of its velocity, cost no kinetic energy in its subtree: those that
its own inertia does not feel and that the joints below can undo. A joint that can make one of them moves no mass, and the
articulated-body algorithm would divide by zero there. This depends on the configuration only through where axes happen
to coincide, so one configuration without coincidences is looked at.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from articulated.rig.description import JointDescription
from articulated.rig.frames import rotation_with_z_along
from articulated.rig.joint import KINDS
from articulated.rig.members import Member
from articulated.rig.rig import Body

_ZERO = 1e-9
"""Below this, relative to a body's own size and mass, an inertia or an angle between subspaces counts as zero."""


def check_mobility(members: Sequence[Member], bodies: Sequence[Body]) -> None:
    """Raise RigError at the first joint, leaves first, that moves no mass and has no armature.

    A coordinate that several joints share is idle if each of them is.
    """
    joints = {member.body: member.joint for member in members if member.joint and member.moves}
    sharing = Counter(_coordinate(joint) for joint in joints.values())
    idle_joints: Counter[str] = Counter()
    idle = [_not_felt(body) for body in bodies]
    for i in reversed(range(len(bodies))):
        body, joint = bodies[i], joints[i]
        subspace, s = _subspace(joint.kind, body.axis), _coordinate(joint)
        if joint.armature == 0.0 and _intersection(idle[i], subspace).shape[1]:
            idle_joints[s] += 1
            if idle_joints[s] == sharing[s]:
                massless = body.mass == 0.0 and not np.any(body.inertia)
                what = "have none" if massless else "do not resist it"
                raise joint.place.error(
                    f"moves no mass: link {body.name!r} and what hangs from it {what}",
                    "give the link a mass and an inertia, the joint armature, or make it fixed",
                )
        if body.parent >= 0:
            gives_way = joint.armature == 0.0 and sharing[s] == 1
            carried = np.hstack([idle[i], subspace]) if gives_way else idle[i]
            in_parent = _motion_to_parent(_generic_pose(body, joint.kind, i)) @ carried
            idle[body.parent] = _intersection(idle[body.parent], in_parent)


def _coordinate(joint: JointDescription) -> str:
    return joint.mimic.joint if joint.mimic else joint.name


def _not_felt(body: Body) -> np.ndarray:
    """Motions (angular, linear) that the body's own inertia does not feel, as orthonormal columns, shape (6, k)."""
    if body.mass == 0.0 and not np.any(body.inertia):
        return np.eye(6)
    size2 = max(np.trace(body.inertia) / body.mass, 1e-6) if body.mass > 0.0 else 1.0
    scale = body.mass if body.mass > 0.0 else np.trace(body.inertia)
    moments, axes = np.linalg.eigh(body.inertia / (scale * size2))
    turns = axes[:, moments < _ZERO]
    # turning about the centre of mass moves the origin with it: v = c × ω
    columns = [np.vstack([turns, np.cross(body.center, turns.T).T])]
    if body.mass == 0.0:
        columns.append(np.vstack([np.zeros((3, 3)), np.eye(3)]))
    return _orthonormal(np.hstack(columns))


def _subspace(kind: str, axis: np.ndarray) -> np.ndarray:
    directions = {
        "prismatic": [5],
        "universal": [2],
        "ball": [0, 1, 2],
        "planar": [2, 3, 4],
        "floating": [0, 1, 2, 3, 4, 5],
    }.get(kind, [2])
    columns = np.eye(6)[:, directions]
    if kind == "universal":
        first = np.concatenate([_turn_about_z(0.7).T @ axis, np.zeros(3)])
        columns = np.column_stack([first, columns])
    assert columns.shape[1] == KINDS[kind].nv
    return columns


def _generic_pose(body: Body, kind: str, index: int) -> np.ndarray:
    """The body in its parent with its joint somewhere where nothing coincides."""
    angle = 0.3 + 0.618033988749895 * (index % 17)
    moved = np.eye(4)
    if kind == "prismatic":
        moved[2, 3] = angle
    elif kind in ("revolute", "continuous"):
        moved[:3, :3] = _turn_about_z(angle)
    else:
        moved[:3, :3] = rotation_with_z_along(np.array([np.cos(angle), 0.4, np.sin(angle)])) @ _turn_about_z(angle)
    return body.pose @ moved


def _turn_about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _motion_to_parent(pose: np.ndarray) -> np.ndarray:
    R, p = pose[:3, :3], pose[:3, 3]
    skew = np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
    return np.block([[R, np.zeros((3, 3))], [skew @ R, R]])


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the span of these columns."""
    if not columns.shape[1]:
        return columns
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, s > _ZERO * max(s[0], 1e-300)]


def _intersection(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A basis of what the spans of A and B share: the principal angles that are zero."""
    A, B = _orthonormal(A), _orthonormal(B)
    if not A.shape[1] or not B.shape[1]:
        return np.zeros((6, 0))
    U, cosines, _ = np.linalg.svd(A.T @ B)
    shared = np.count_nonzero(cosines > 1.0 - _ZERO)
    return A @ U[:, :shared]
