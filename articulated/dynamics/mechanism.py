"""A rig as the recursions see it: constants as floats in spatial types, one entry a body, parents first.

Every algorithm takes a `Mechanism` first, and its other arguments as lists of scalars. A joint that follows another has no
coordinate of its own: it moves with its leader's, along S times the ratio. Two joints that share a coordinate are the only
thing here that is not in RBDA.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from articulated.dynamics.frames import chosen_frames, without_rounding
from articulated.dynamics.joints import JointModel, joint_model
from articulated.rig import Rig
from articulated.rig.joint import KINDS
from articulated.scalar import Scalar
from articulated.spatial import Mat3, Motion, Pose, RigidInertia, Sym3, Turns, Vec3

WORLD = -1


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """The joint of one body.

    Attributes:
        name, model: the joint, and what its kind can do.
        q: indices of its configuration (its leader's, if it follows one).
        v: indices of its velocities (likewise).
        ratio, offset: 1 and 0, unless it follows another.
    """

    name: str
    model: JointModel
    q: tuple[int, ...]
    v: tuple[int, ...]
    ratio: float = 1.0
    offset: float = 0.0
    follows: bool = False

    def configuration(self, q: Sequence[Scalar]) -> list[Scalar]:
        """Its own part of q."""
        if self.follows:
            return [q[k] * self.ratio + self.offset for k in self.q]
        return [q[k] for k in self.q]

    def velocity(self, v: Sequence[Scalar]) -> list[Scalar]:
        """Its own part of v."""
        if self.follows:
            return [v[k] * self.ratio for k in self.v]
        return [v[k] for k in self.v]

    def subspace(self, q: Sequence[Scalar]) -> list[Motion]:
        """S: the motion of its body for each coordinate in `v`."""
        S = self.model.subspace(self.configuration(q))
        return [column * self.ratio for column in S] if self.follows else S


@dataclass(frozen=True, eq=False)
class Mechanism:
    """The constants of a rig.

    Attributes:
        parent: index of each body's parent, `WORLD` or less than its own.
        joints: the joint of each body.
        placement: `X_PB`, each body in its parent when q is neutral.
        inertia: of each body, about its origin.
        closes: for each body, the coordinates that nothing outside its subtree moves with and something in it does: its own
            joint's, and those shared by joints of which it is the nearest common ancestor. `closes[WORLD]` likewise.
        links: each link's body and its pose `X_BL` in it.
        armature, damping, friction: of each coordinate.
    """

    rig: Rig
    parent: tuple[int, ...]
    joints: tuple[TreeJoint, ...]
    placement: tuple[Pose, ...]
    inertia: tuple[RigidInertia, ...]
    closes: dict[int, list[int]]
    links: tuple[tuple[int, Pose], ...]
    armature: tuple[float, ...]
    damping: tuple[float, ...]
    friction: tuple[float, ...]

    @property
    def nbodies(self) -> int:
        return len(self.parent)

    @property
    def nq(self) -> int:
        return self.rig.nq

    @property
    def nv(self) -> int:
        return len(self.armature)

    @cached_property
    def free_roots(self) -> tuple[int, ...]:
        """Bodies that float in the world."""
        kinds = [self.rig.joints[joint.name].kind for joint in self.joints]
        return tuple(i for i, p in enumerate(self.parent) if p == WORLD and kinds[i] == "floating")

    def own_joints(self) -> list[TreeJoint]:
        """The joints that have coordinates of their own, in the order of these."""
        return [joint for joint in self.joints if not joint.follows]

    def support(self, body: int) -> list[int]:
        """Bodies from this one to the root."""
        path = []
        while body != WORLD:
            path.append(body)
            body = self.parent[body]
        return path


def mechanism(rig: Rig) -> Mechanism:
    """The mechanism of a rig."""
    joints = tuple(_tree_joint(rig, body.joint, body.axis) for body in rig.bodies)
    parent = tuple(body.parent for body in rig.bodies)
    one_axis = [KINDS[rig.joints[body.joint].kind].nq == 1 for body in rig.bodies]
    frames = chosen_frames(parent, [body.pose for body in rig.bodies], one_axis)
    back = [*(np.linalg.inv(T) for T in frames), np.eye(4)]  # the last is the world's, index -1
    return Mechanism(
        rig=rig,
        parent=parent,
        joints=joints,
        placement=tuple(_placement(back[body.parent] @ body.pose @ T) for body, T in zip(rig.bodies, frames, strict=True)),
        inertia=tuple(
            _inertia(body.mass, T[:3, :3] @ body.center + T[:3, 3], T[:3, :3] @ body.inertia @ T[:3, :3].T)
            for body, T in zip(rig.bodies, back, strict=False)
        ),
        closes=_closes(parent, joints),
        links=tuple((link.body, _pose(back[link.body] @ link.pose)) for link in rig.links.values()),
        armature=tuple(rig.armature.tolist()),
        damping=tuple(rig.damping.tolist()),
        friction=tuple(rig.friction.tolist()),
    )


def content(rig: Rig) -> bytes:
    """All of a rig that a mechanism is made of, and nothing else: rigs of equal content move alike."""
    joints = [(j.name, j.kind, j.q_slice, j.v_slice, j.damping, j.friction, j.armature, j.mimic) for j in rig.joints.values()]
    bodies = [(b.parent, b.joint, b.mass, *(x.tobytes() for x in (b.pose, b.axis, b.center, b.inertia))) for b in rig.bodies]
    links = [(link.body, link.pose.tobytes()) for link in rig.links.values()]
    return repr((joints, bodies, links)).encode()


def _tree_joint(rig: Rig, name: str, axis: np.ndarray) -> TreeJoint:
    joint = rig.joints[name]
    owner = rig.joints[joint.mimic.joint] if joint.mimic else joint
    q, v = (tuple(range(s.start, s.stop)) for s in (owner.q_slice, owner.v_slice))
    model = joint_model(joint.kind, axis.tolist())
    assert len(v) == KINDS[joint.kind].nv
    if joint.mimic:
        return TreeJoint(name, model, q, v, joint.mimic.multiplier, joint.mimic.offset, follows=True)
    return TreeJoint(name, model, q, v)


def _closes(parent: Sequence[int], joints: Sequence[TreeJoint]) -> dict[int, list[int]]:
    lowest: dict[int, int] = {}
    for i, joint in enumerate(joints):
        for s in joint.v:
            lowest[s] = _common_ancestor(parent, lowest[s], i) if s in lowest else i
    closes: dict[int, list[int]] = {i: [] for i in range(WORLD, len(parent))}
    for s, body in lowest.items():
        closes[body].append(s)
    return closes


def _common_ancestor(parent: Sequence[int], i: int, j: int) -> int:
    while i != j:
        if i > j:
            i = parent[i]
        else:
            j = parent[j]
    return i


def _placement(matrix: np.ndarray) -> Pose:
    p = matrix[:3, 3]
    return Pose(Turns.of(matrix[:3, :3].tolist()), Vec3.of(without_rounding(p, np.abs(p).max()).tolist()))


def _pose(matrix: np.ndarray) -> Pose:
    return Pose(Mat3.of(matrix[:3, :3].tolist()), Vec3.of(matrix[:3, 3].tolist()))


def _inertia(mass: float, center: np.ndarray, inertia: np.ndarray) -> RigidInertia:
    J = inertia + mass * (center @ center * np.eye(3) - np.outer(center, center))
    J, center = without_rounding(J, np.abs(J).max()), without_rounding(center, np.abs(center).max())
    return RigidInertia(float(mass), Vec3.of((mass * center).tolist()), Sym3.of(J.tolist()))
