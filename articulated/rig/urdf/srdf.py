"""Pairs of links that may not collide, from SRDF (MoveIt's companion of a URDF) and from URDF, which has the same elements.

`<disable_collisions link1 link2>` is a pair; `<disable_default_collisions link>` a link with all others, of which
`<enable_collisions link1 link2>` takes pairs out again. As in MoveIt they count in the order default, enable, disable, wherever
they stand in a document: a pair that is named in both of the last two is disabled. An SRDF comes after its URDF. Their
`reason` is not kept.
"""

from __future__ import annotations

from articulated.rig.builder import RigBuilder
from articulated.rig.errors import Place, RigError
from articulated.rig.urdf.xml import Node, check_expanded, count_strangers, parse

DEFAULT, ENABLE, DISABLE = "disable_default_collisions", "enable_collisions", "disable_collisions"

_OF_PLANNERS = {
    *("group", "group_state", "end_effector", "virtual_joint", "passive_joint", "joint_property", "link_sphere_approximation"),
    *("gripper", "handle", "contact", "rotor_params", "specificities"),
}
"""Elements of SRDF that say nothing to a simulation of ours; the second line is of HPP and of Pinocchio."""


def read_srdf(text: bytes, source: str, builder: RigBuilder) -> None:
    """Add what an SRDF document says of collisions.

    Args:
        text: the document.
        source: what errors call it.
        builder: with the links of its URDF.

    Raises:
        RigError: the document is malformed.
    """
    root = parse(text, source, "SRDF")
    if root.tag != "robot":
        raise RigError(source, root.sourceline, f"<{root.tag}>", "is not an SRDF", "its root element must be <robot>")
    robot = Node(root, Place(source, "", root.sourceline))
    check_expanded(robot, "SRDF")
    count_strangers([robot], {DEFAULT, ENABLE, DISABLE}, _OF_PLANNERS)
    read_collisions(robot, builder)


def read_collisions(robot: Node, builder: RigBuilder) -> None:
    """Add what the top level of a document says of collisions.

    Raises:
        RigError: an element names no link.
    """
    for node in robot.children(DEFAULT):
        builder.disable_collisions(node.need_text("link"), place=node.place)
    for node in robot.children(ENABLE):
        builder.enable_collisions(node.need_text("link1"), node.need_text("link2"), place=node.place)
    for node in robot.children(DISABLE):
        builder.disable_collisions(node.need_text("link1"), node.need_text("link2"), place=node.place)
