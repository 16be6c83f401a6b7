"""Several rigs in one: characters that hold hands, a rider and a bicycle, a hand and what it holds."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

from articulated.rig.builder import RigBuilder
from articulated.rig.errors import RigWarning
from articulated.rig.fit import is_world
from articulated.rig.joint import Joint
from articulated.rig.loop import Loop
from articulated.rig.rig import Rig

WORLD = "world"


def compose(*rigs: Rig, **named: Rig) -> Rig:
    """One rig of several, with one configuration and one solve.

        pair = art.compose(left=dancer, right=dancer)
        pair.links["left/right_hand"], pair.joints["right/left_elbow"]
        held = art.Loop("point", "left/right_hand", None, "right/left_hand", None)

    Configurations and velocities are those of the rigs, one after the other. All hang from a link "world".

    Args:
        rigs: each under its own name.
        named: each under the name given.

    Returns:
        The rig. Names of links, joints and loops in it begin with the name of their rig and a slash.

    Raises:
        ValueError: there is none, or two have one name.
    """
    parts = [*((rig.name, rig) for rig in rigs), *named.items()]
    names = [name for name, _ in parts]
    if not parts:
        raise ValueError("compose was given no rig; expected one at least")
    if len(set(names)) < len(names):
        raise ValueError(f"rigs are named {', '.join(map(repr, names))}; give each its own: compose(left=…, right=…)")
    builder = RigBuilder(" + ".join(names))
    builder.link(WORLD)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RigWarning)  # all was said when the rigs were first made
        for name, rig in parts:
            _add(builder, name, rig)
        return builder.build()


def _add(builder: RigBuilder, name: str, rig: Rig) -> None:
    for link in rig.links.values():
        builder.link(f"{name}/{link.name}", link.mass, link.center, link.inertia, link.collisions, link.visuals)
    hung: set[str] = set()
    for joint in rig.joints.values():
        _joint(builder, name, joint)
        hung.add(joint.child)
    for fixed in rig.fixed_joints.values():
        builder.joint(f"{name}/{fixed.name}", "fixed", f"{name}/{fixed.parent}", f"{name}/{fixed.child}", pose=fixed.pose)
        hung.add(fixed.child)
    for root in [link for link in rig.links if link not in hung]:
        builder.joint(f"{name}/{WORLD}", "fixed", WORLD, f"{name}/{root}")
    for loop in rig.loops:
        builder.loop(_renamed(loop, name, rig))
    for link1, link2 in rig.disabled_collisions:
        builder.disable_collisions(f"{name}/{link1}", f"{name}/{link2}")


def _joint(builder: RigBuilder, name: str, joint: Joint) -> None:
    mimic = replace(joint.mimic, joint=f"{name}/{joint.mimic.joint}") if joint.mimic else None
    builder.joint(
        f"{name}/{joint.name}",
        joint.kind,
        f"{name}/{joint.parent}" if joint.parent else WORLD,
        f"{name}/{joint.child}",
        pose=joint.pose,
        axis=joint.axis,
        axis2=joint.axis2,
        limits=joint.limits,
        damping=joint.damping,
        friction=joint.friction,
        armature=joint.armature,
        mimic=mimic,
    )


def _renamed(loop: Loop, name: str, rig: Rig) -> Loop:
    ends: Sequence[str | None] = [None if is_world(rig, end) else f"{name}/{end}" for end in (loop.link_a, loop.link_b)]
    return replace(loop, link_a=ends[0], link_b=ends[1], name=f"{name}/{loop.name}")
