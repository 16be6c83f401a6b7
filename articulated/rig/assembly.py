"""From single links and joints to a rig: the tree, its coordinates, and the bodies that fixed joints make.

Links joined by fixed joints become one body (parallel-axis theorem, RBDA 2.66); the frame of a body is the frame of the
link that its joint moves, turned once so that the joint's axis is its z axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from articulated.rig.description import (
    INERTIA_TOLERANCE,
    JointDescription,
    LinkDescription,
    repaired,
    violation,
)
from articulated.rig.errors import Place
from articulated.rig.frames import snapped
from articulated.rig.joint import KINDS, Joint, Limits
from articulated.rig.members import Member, walk
from articulated.rig.mobility import check_mobility
from articulated.rig.rig import Body, FixedJoint, Link, Rig
from articulated.rig.tree import check_tree, resolve_mimics

ROOT_JOINT = "root_joint"
"""The joint that lets the root link of a free or planar rig move."""

_ROOT_KINDS = {"free": "floating", "planar": "planar"}


def assemble(
    name: str,
    place: Place,
    links: Sequence[LinkDescription],
    joints: Sequence[JointDescription],
    root: str,
    repair_inertia: bool,
    source: str,
    ignored: Mapping[str, int],
) -> Rig:
    """The rig of these links and joints; see `RigBuilder.build`."""
    joint_to = check_tree(place, links, joints)
    joints = resolve_mimics(joints)
    root_link = next(link for link in links if link.name not in joint_to)
    if root != "fixed":
        joints = [*joints, _root_joint(root, root_link.name, place)]
    if repair_inertia:
        links = [_repair(link) for link in links]

    members = walk(root_link, links, joints)
    bodies = _bodies(members)
    check_mobility(members, bodies)
    rig_joints = _joints(members)
    return Rig(
        name=name,
        root=root,
        joints=MappingProxyType(rig_joints),
        links=MappingProxyType({m.link.name: _link(m, index) for index, m in enumerate(members)}),
        fixed_joints=MappingProxyType(
            {m.joint.name: _fixed_joint(m.joint) for m in members if m.joint and m.joint.kind == "fixed"}
        ),
        bodies=tuple(bodies),
        source=source,
        ignored=MappingProxyType(dict(ignored)),
    )


def _root_joint(root: str, link: str, place: Place) -> JointDescription:
    return JointDescription(
        name=ROOT_JOINT,
        kind=_ROOT_KINDS[root],
        parent="",
        child=link,
        pose=np.eye(4),
        axis=np.array([0.0, 0.0, 1.0]),
        axis2=None,
        limits=Limits(),
        damping=0.0,
        friction=0.0,
        armature=0.0,
        mimic=None,
        place=replace(place, element=f"joint {ROOT_JOINT!r}"),
    )


def _repair(link: LinkDescription) -> LinkDescription:
    return replace(link, inertia=repaired(link.inertia)) if violation(link.inertia, link.mass) > 0.0 else link


class _Sum(NamedTuple):
    """Mass, first moment and rotational inertia about the origin, of links together."""

    mass: float
    h: np.ndarray
    J: np.ndarray


def _about_origin(member: Member) -> _Sum:
    R, p = member.pose[:3, :3], member.pose[:3, 3]
    mass, c = member.link.mass, R @ member.link.center + p
    J = R @ member.link.inertia @ R.T + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return _Sum(mass, mass * c, J)


def _bodies(members: Sequence[Member]) -> list[Body]:
    parts: dict[int, list[Member]] = {}
    for member in members:
        parts.setdefault(member.body, []).append(member)
    bodies = []
    for index in sorted(parts):
        group = parts[index]
        sums = [_about_origin(member) for member in group]
        mass = float(sum(s.mass for s in sums))
        center = np.sum([s.h for s in sums], axis=0) / mass if mass > 0.0 else np.zeros(3)
        if len(group) == 1 or mass == 0.0:
            inertia = np.sum([m.pose[:3, :3] @ m.link.inertia @ m.pose[:3, :3].T for m in group], axis=0)
        else:
            inertia = np.sum([s.J for s in sums], axis=0) - mass * (center @ center * np.eye(3) - np.outer(center, center))
        _check_inertia(group, inertia, moves=index >= 0)
        if index < 0:
            continue
        first = group[0]
        assert first.joint is not None
        bodies.append(
            Body(
                name=first.link.name,
                parent=first.parent_body,
                joint=first.joint.name,
                pose=_frozen(first.pose_at_neutral),
                axis=_frozen(first.axis),
                mass=mass,
                center=_frozen(snapped(center)),
                inertia=_frozen(0.5 * (inertia + inertia.T)),
            )
        )
    return bodies


def _check_inertia(group: Sequence[Member], inertia: np.ndarray, moves: bool) -> None:
    """Refuse a body that no mass could make; only warn of a link whose fault the rest of its body makes good."""
    mass = sum(member.link.mass for member in group)
    faults = [violation(member.link.inertia, member.link.mass) for member in group]
    by = max(faults)
    worst = group[faults.index(by)]
    reason = f"inertia violates the triangle inequality by {100.0 * by:.3g} %"
    if np.linalg.eigvalsh(worst.link.inertia)[0] < -1e-9 * np.abs(worst.link.inertia).max():
        reason = "inertia has a negative principal moment"
    if moves and violation(inertia, mass) > INERTIA_TOLERANCE:
        if by <= INERTIA_TOLERANCE:
            reason = "the body that it forms with the links fixed to it has an impossible inertia"
        raise worst.link.place.error(reason, "correct it, or load with repair_inertia=True")
    if by > INERTIA_TOLERANCE:
        what = "the body that it is fixed to makes up for it" if moves else "it does not move, so nothing depends on it"
        worst.link.place.warn(reason, what)


def _joints(members: Sequence[Member]) -> dict[str, Joint]:
    joints: dict[str, Joint] = {}
    nq = nv = 0
    for member in members:
        d = member.joint
        if d is None or d.kind == "fixed":
            continue
        kind = KINDS[d.kind]
        own_q, own_v = (0, 0) if d.mimic else (kind.nq, kind.nv)
        joints[d.name] = Joint(
            name=d.name,
            kind=d.kind,
            parent=d.parent,
            child=d.child,
            body=member.body,
            pose=_frozen(d.pose),
            axis=_frozen(d.axis / np.linalg.norm(d.axis)),
            axis2=None if d.axis2 is None else _frozen(d.axis2 / np.linalg.norm(d.axis2)),
            q_slice=slice(nq, nq + own_q),
            v_slice=slice(nv, nv + own_v),
            limits=d.limits,
            damping=d.damping,
            friction=d.friction,
            armature=d.armature,
            mimic=d.mimic,
        )
        nq, nv = nq + own_q, nv + own_v
    return joints


def _link(member: Member, index: int) -> Link:
    link = member.link
    return Link(
        name=link.name,
        index=index,
        body=member.body,
        pose=_frozen(member.pose),
        joint=member.joint.name if member.joint else "",
        mass=link.mass,
        center=_frozen(link.center),
        inertia=_frozen(link.inertia),
        collisions=link.collisions,
        visuals=link.visuals,
    )


def _fixed_joint(d: JointDescription) -> FixedJoint:
    return FixedJoint(d.name, d.parent, d.child, _frozen(d.pose))


def _frozen(values: np.ndarray) -> np.ndarray:
    result = np.array(values, dtype=float)
    result.flags.writeable = False
    return result
