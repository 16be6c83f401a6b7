"""Whether links and joints form a tree, and who follows whom."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from articulated.rig.description import JointDescription, LinkDescription
from articulated.rig.errors import Place
from articulated.rig.joint import KINDS, Mimic


def _check_names(place: Place, links: Sequence[LinkDescription], joints: Sequence[JointDescription]) -> None:
    if not links:
        raise place.error("has no links", "a rig needs one at least")
    for what, named in (("link", links), ("joint", joints)):
        for name, count in Counter(one.name for one in named).items():
            if count > 1:
                second = [one for one in named if one.name == name][1]
                raise second.place.error(f"{count} {what}s have this name", "rename all but one")
    known = {link.name for link in links}
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in known:
                raise joint.place.error(f"its {role} link {link!r} does not exist", "add the link or correct the name")


def check_tree(
    place: Place, links: Sequence[LinkDescription], joints: Sequence[JointDescription]
) -> dict[str, JointDescription]:
    """The joint to each link but the root's, if links and joints do form one tree.

    Raises:
        RigError: they do not, or names are doubled or lead nowhere.
    """
    _check_names(place, links, joints)
    joint_to: dict[str, JointDescription] = {}
    for joint in joints:
        if (other := joint_to.setdefault(joint.child, joint)) is not joint:
            raise joint.place.error(
                f"link {joint.child!r} already hangs by joint {other.name!r}",
                "a link has one parent; close loops with art.Loop instead",
            )
    roots = [link for link in links if link.name not in joint_to]
    if not roots:
        raise place.error("has no root link: its joints form a loop", "some link must hang by no joint")
    if len(roots) > 1:
        names = ", ".join(repr(link.name) for link in roots)
        raise roots[1].place.error(f"the rig has {len(roots)} root links: {names}", "join them, or load them apart")
    parent_of = {joint.child: joint.parent for joint in joints}
    reached = {roots[0].name}
    for link in links:
        path = []
        at = link.name
        while at not in reached:
            if at in path:
                loop = path[path.index(at) :]
                raise joint_to[at].place.error(
                    f"closes a loop of links: {' -> '.join([*reversed(loop), loop[-1]])}",
                    "a rig is a tree; close loops with art.Loop instead",
                )
            path.append(at)
            at = parent_of[at]
        reached.update(path)
    return joint_to


def resolve_mimics(joints: Sequence[JointDescription]) -> list[JointDescription]:
    """The same joints, each follower of a follower made to follow the first leader.

    Raises:
        RigError: a joint follows itself, one that does not exist, or one without a single coordinate.
    """
    by_name = {joint.name: joint for joint in joints}

    def resolved(joint: JointDescription) -> JointDescription:
        mimic, seen = joint.mimic, [joint.name]
        if mimic is None:
            return joint
        if joint.kind == "fixed":
            joint.place.warn("is fixed and cannot follow another joint", "its mimic is ignored")
            return replace(joint, mimic=None)
        multiplier, offset, leader_name = mimic.multiplier, mimic.offset, mimic.joint
        while True:
            leader = by_name.get(leader_name)
            if leader is None:
                raise joint.place.error(f"follows joint {leader_name!r}, which does not exist", "correct the mimic")
            if leader_name in seen:
                raise joint.place.error(f"follows itself: {' -> '.join([*seen, leader_name])}", "break the circle")
            if leader.kind == "fixed" or KINDS[leader.kind].nv != 1:
                raise joint.place.error(
                    f"follows joint {leader_name!r}, which is {leader.kind}", "follow a joint of one coordinate"
                )
            if leader.mimic is None:
                return replace(joint, mimic=Mimic(leader_name, multiplier, offset))
            seen.append(leader_name)
            offset += multiplier * leader.mimic.offset
            multiplier *= leader.mimic.multiplier
            leader_name = leader.mimic.joint

    return [resolved(joint) for joint in joints]
