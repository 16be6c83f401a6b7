"""Closed loops in URDF.

`<constraint>` is the element proposed for URDF in 2026 (ros/urdfdom, pull request 264): a loop cut open, closed again between
a frame of one link and one of another. Its axes are in these frames. Drake has `<drake:ball_constraint>`, two points that
coincide.
"""

from __future__ import annotations

import numpy as np

from articulated.rig.builder import RigBuilder
from articulated.rig.loop import Loop
from articulated.rig.urdf.origin import origin_of
from articulated.rig.urdf.writer import CONSTRAINTS
from articulated.rig.urdf.xml import Node

DRAKE = "{http://drake.mit.edu}"
BALL = f"{DRAKE}ball_constraint"


def read_constraints(robot: Node, builder: RigBuilder) -> None:
    """Add the loops of a document.

    Raises:
        RigError: one is malformed.
    """
    for node in robot.children("constraint"):
        name = node.need_text("name")
        _constraint(robot.inner(node.element, f"constraint {name!r}"), builder)
    for node in robot.children(BALL):
        _ball(robot.inner(node.element, "<drake:ball_constraint>"), builder)


def _constraint(node: Node, builder: RigBuilder) -> None:
    type_ = node.need_text("type")
    kind = CONSTRAINTS.get(type_.removesuffix("_joint"))
    if kind is None:
        raise node.place.error(
            f"unknown type {type_!r}", f"use one of {', '.join(CONSTRAINTS)}; add others with RigBuilder.loop"
        )
    ends = [node.need(end).need_text("link") for end in ("parent", "child")]
    poses = [origin_of(node, f"{end}_origin") for end in ("parent", "child")]
    axes: dict[str, list[float]] = {}
    if kind in ("hinge", "slider", "universal"):
        axes["axis"] = _axis(node, "parent_axis")
    if kind == "universal":
        axes["axis2"] = _axis(node, "child_axis")
    _add(node, builder, kind, ends, poses, name=node.need_text("name"), **axes)


def _axis(node: Node, tag: str) -> list[float]:
    axis = node.child(tag)
    return axis.numbers("xyz", 3) if axis else [1.0, 0.0, 0.0]


def _ball(node: Node, builder: RigBuilder) -> None:
    ends = [node.need(f"{BALL}_body_{end}").need_text("name") for end in "AB"]
    points = [np.array(node.need(f"{BALL}_{name}").numbers("value", 3)) for name in ("p_AP", "p_BQ")]
    _add(node, builder, "point", ends, points)


def _add(node: Node, builder: RigBuilder, kind: str, ends: list[str], poses: list[np.ndarray], **rest) -> None:
    try:
        loop = Loop(kind, ends[0], poses[0], ends[1], poses[1], **rest)
    except ValueError as error:
        raise node.place.error(str(error), "correct it") from None
    builder.loop(loop, place=node.place)
