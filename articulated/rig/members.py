"""Links in their places in the tree, each with the body it is part of and its frame in that body's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from articulated.rig.description import JointDescription, LinkDescription
from articulated.rig.frames import inverse, rotation_with_z_along, snapped


@dataclass(frozen=True, eq=False)
class Member:
    """A link in its place in the tree.

    Attributes:
        link: the link.
        joint: the joint by which it hangs; None for a root fixed to the world.
        body: index of the body it is part of, -1 for the world.
        parent_body: of the body that its joint hangs from.
        pose: the link's frame in its body's.
        pose_at_neutral: for the first link of a body: the body's frame in its parent body's when q is neutral.
        axis: likewise, the joint's first axis in the body's frame.
    """

    link: LinkDescription
    joint: JointDescription | None
    body: int
    parent_body: int
    pose: np.ndarray
    pose_at_neutral: np.ndarray
    axis: np.ndarray

    @property
    def moves(self) -> bool:
        return self.joint is not None and self.joint.kind != "fixed"


def walk(root: LinkDescription, links: Sequence[LinkDescription], joints: Sequence[JointDescription]) -> list[Member]:
    """Links in tree order, depth first, siblings as in the source; a body is numbered when its first link is met."""
    by_name = {link.name: link for link in links}
    children: dict[str, list[JointDescription]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)

    members: list[Member] = []
    nbodies = 0
    first_joint = next(iter(children.get("", [])), None)
    to_visit: list[tuple[LinkDescription, JointDescription | None, Member | None]] = [(root, first_joint, None)]
    while to_visit:
        link, joint, parent = to_visit.pop()
        member = _member(link, joint, parent, nbodies)
        nbodies += member.moves
        members.append(member)
        to_visit.extend((by_name[hangs.child], hangs, member) for hangs in reversed(children.get(link.name, [])))
    return members


def _member(link: LinkDescription, joint: JointDescription | None, parent: Member | None, nbodies: int) -> Member:
    parent_body = parent.body if parent else -1
    parent_pose = parent.pose if parent else np.eye(4)
    z = np.array([0.0, 0.0, 1.0])
    joint_pose = parent_pose @ joint.pose if joint else parent_pose
    if joint is None or joint.kind == "fixed":
        return Member(link, joint, parent_body, parent_body, snapped(joint_pose), np.eye(4), z)
    to_body = np.eye(4)
    axis = z
    if joint.kind == "universal":
        assert joint.axis2 is not None
        to_body[:3, :3] = rotation_with_z_along(joint.axis2)
        axis = snapped(to_body[:3, :3].T @ (joint.axis / np.linalg.norm(joint.axis)))
    elif joint.kind not in ("ball", "floating"):
        to_body[:3, :3] = rotation_with_z_along(joint.axis)
    return Member(link, joint, nbodies, parent_body, inverse(to_body), snapped(joint_pose @ to_body), axis)
