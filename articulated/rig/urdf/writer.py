"""A rig as URDF text, version 1.2 with the additions that `reader` names; numbers read back exactly."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from articulated.rig.errors import Place
from articulated.rig.joint import Joint
from articulated.rig.loop import Loop
from articulated.rig.shapes import Box, Mesh, Shape, Sphere

if TYPE_CHECKING:
    from articulated.rig.rig import FixedJoint, Link, Rig

_TINY = 1e-13

SWING_TWIST = "swing_twist"
"""The element of a ball joint that says how far it may swing and twist; see `SwingTwist`."""

CONSTRAINTS = {"spherical": "point", "revolute": "hinge", "prismatic": "slider", "universal": "universal", "link": "weld"}
"""Types of `<constraint>`, and our kinds of loops; a type may also end in _joint."""


def urdf_text(rig: Rig) -> str:
    """The text; the joint that `root` adds is not part of it."""
    robot = etree.Element("robot", name=rig.name, version="1.2")
    hangs_by: dict[str, Joint | FixedJoint] = {joint.child: joint for joint in rig.joints.values()}
    hangs_by |= {joint.child: joint for joint in rig.fixed_joints.values()}
    for link in rig.links.values():
        _add_link(robot, link)
    for link in rig.links.values():
        joint = hangs_by.get(link.name)
        if joint is not None and joint.parent:
            _add_joint(robot, joint)
    if lost := [loop.name for loop in rig.loops if not _add_constraint(robot, loop)]:
        names = ", ".join(map(repr, lost))
        Place(rig.name).warn(f"URDF has no constraint for loops {names}", "add them again with RigBuilder.loop or loops=[…]")
    for link1, link2 in rig.disabled_collisions:
        etree.SubElement(robot, "disable_collisions", link1=link1, link2=link2)
    return etree.tostring(robot, pretty_print=True, encoding="unicode")


def _add_link(robot: etree._Element, link: Link) -> None:
    element = etree.SubElement(robot, "link", name=link.name)
    if link.mass or np.any(link.inertia):
        inertial = etree.SubElement(element, "inertial")
        etree.SubElement(inertial, "origin", xyz=_words(link.center))
        etree.SubElement(inertial, "mass", value=_words([link.mass]))
        I = link.inertia
        moments = {"ixx": I[0, 0], "ixy": I[0, 1], "ixz": I[0, 2], "iyy": I[1, 1], "iyz": I[1, 2], "izz": I[2, 2]}
        etree.SubElement(inertial, "inertia", {key: _words([value]) for key, value in moments.items()})
    for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for shape in shapes:
            _add_shape(element, tag, shape)


def _add_shape(link: etree._Element, tag: str, shape: Shape) -> None:
    element = etree.SubElement(link, tag, {"name": shape.name} if shape.name else {})
    _add_origin(element, shape.pose)
    geometry = etree.SubElement(element, "geometry")
    what = shape.geometry
    if isinstance(what, Mesh):
        etree.SubElement(geometry, "mesh", filename=what.filename, scale=_words(what.scale))
    elif isinstance(what, Box):
        etree.SubElement(geometry, "box", size=_words(what.size))
    elif isinstance(what, Sphere):
        etree.SubElement(geometry, "sphere", radius=_words([what.radius]))
    else:
        tag = type(what).__name__.lower()
        etree.SubElement(geometry, tag, radius=_words([what.radius]), length=_words([what.length]))
    if shape.color:
        material = etree.SubElement(element, "material", name="")
        etree.SubElement(material, "color", rgba=_words(shape.color))


def _add_joint(robot: etree._Element, joint: Joint | FixedJoint) -> None:
    kind = joint.kind if isinstance(joint, Joint) else "fixed"
    element = etree.SubElement(robot, "joint", name=joint.name, type=kind)
    _add_origin(element, joint.pose)
    etree.SubElement(element, "parent", link=joint.parent)
    etree.SubElement(element, "child", link=joint.child)
    if not isinstance(joint, Joint):
        return
    etree.SubElement(element, "axis", xyz=_words(joint.axis))
    if joint.axis2 is not None:
        etree.SubElement(element, "axis2", xyz=_words(joint.axis2))
    limits = {key: value for key, value in vars(joint.limits).items() if key != "ball" and math.isfinite(value)}
    if limits or joint.kind in ("revolute", "prismatic"):
        etree.SubElement(element, "limit", {key: _words([value]) for key, value in limits.items()})
    if (ball := joint.limits.ball) is not None:
        numbers = {name: _words(getattr(ball, name)) for name in ("axis", "toward", "swing", "twist")}
        etree.SubElement(element, SWING_TWIST, numbers)
    passive = {key: getattr(joint, key) for key in ("damping", "friction", "armature") if getattr(joint, key)}
    if passive:
        etree.SubElement(element, "dynamics", {key: _words([value]) for key, value in passive.items()})
    if joint.mimic:
        numbers = {"multiplier": _words([joint.mimic.multiplier]), "offset": _words([joint.mimic.offset])}
        etree.SubElement(element, "mimic", {"joint": joint.mimic.joint, **numbers})


def _add_constraint(robot: etree._Element, loop: Loop) -> bool:
    """Whether there is a constraint for a loop, which then is added."""
    types = {kind: type_ for type_, kind in CONSTRAINTS.items()}
    if loop.kind not in types or None in (loop.link_a, loop.link_b):
        return False
    element = etree.SubElement(robot, "constraint", name=loop.name, type=types[loop.kind])
    axes = loop.axis, loop.axis if loop.axis2 is None else loop.axis2
    for end, link, pose, axis in zip(("parent", "child"), (loop.link_a, loop.link_b), loop.poses, axes, strict=True):
        etree.SubElement(element, end, link=str(link))
        _add_origin(element, pose, f"{end}_origin")
        if axis is not None:
            etree.SubElement(element, f"{end}_axis", xyz=_words(np.asarray(axis)))
    return True


def _add_origin(parent: etree._Element, pose: np.ndarray, tag: str = "origin") -> None:
    if np.any(pose != np.eye(4)):
        etree.SubElement(parent, tag, {"xyz": _words(pose[:3, 3]), **_orientation(pose[:3, :3])})


def _orientation(R: np.ndarray) -> dict[str, str]:
    """As quat_xyzw: the four candidates of Shepperd's method, the largest divisor chosen."""
    squares = np.array([1 + R[0, 0] - R[1, 1] - R[2, 2], 1 - R[0, 0] + R[1, 1] - R[2, 2], 1 - R[0, 0] - R[1, 1] + R[2, 2]])
    squares = np.append(squares, 1 + R[0, 0] + R[1, 1] + R[2, 2])
    x, y, z, w = (
        [squares[0], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
        [R[0, 1] + R[1, 0], squares[1], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
        [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], squares[2], R[1, 0] - R[0, 1]],
        [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], squares[3]],
    )[int(np.argmax(squares))]
    quat = np.array([x, y, z, w])
    return {} if np.allclose(R, np.eye(3), atol=_TINY) else {"quat_xyzw": _words(quat / np.linalg.norm(quat))}


def _words(values) -> str:
    return " ".join(repr(float(value)).removesuffix(".0") for value in values)
