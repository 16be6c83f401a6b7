"""URDF, versions 1.0 to 1.2, read strictly: every error names file, line and element.

Beyond the standard: joint types `ball` (also called `spherical`) and `universal` (`<axis>` and a second `<axis2>`), and an
`armature` beside damping and friction in `<dynamics>`; `<swing_twist>`, the limits of a ball joint; closed loops, see
`constraints`; pairs of links that may not collide, see `srdf`. Read with lxml: yourdfpy keeps neither lines nor these.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from lxml import etree

from articulated.rig.builder import RigBuilder
from articulated.rig.errors import Place, RigError
from articulated.rig.joint import ALIASES, Limits, Mimic
from articulated.rig.shapes import PLAIN_SHAPES, Box, Capsule, Cylinder, Geometry, Mesh, Shape, Sphere
from articulated.rig.swing_twist import SwingTwist
from articulated.rig.urdf import files
from articulated.rig.urdf.constraints import BALL, read_constraints
from articulated.rig.urdf.origin import origin_of
from articulated.rig.urdf.srdf import DEFAULT, DISABLE, ENABLE, read_collisions
from articulated.rig.urdf.writer import SWING_TWIST
from articulated.rig.urdf.xml import Node, check_expanded, count_strangers, parse

Color = tuple[float, float, float, float]

_MEANINGFUL = {
    "robot": {"link", "joint", "material", "constraint", BALL, DEFAULT, ENABLE, DISABLE},
    "link": {"inertial", "collision", "visual"},
    "joint": {"origin", "parent", "child", "axis", "axis2", "limit", "dynamics", "mimic", SWING_TWIST},
}
_OF_OTHERS = {
    "robot": {"gazebo", "transmission", "sensor", "ros2_control", "group_state", "verbose"},
    "link": {"contact", "gazebo", "sensor", "self_collision_checking", "collision_checking", "verbose"},
    "joint": {"safety_controller", "calibration", "hardwareInterface", "gazebo", "transmission"},
}
"""Elements that other tools put there and that say nothing to a simulation of ours: counted, but not warned of."""


def read_urdf(text: bytes, source: str, directory: Path | None, mesh_dirs: Sequence[Path]) -> RigBuilder:
    """A builder with the links and joints of a URDF document.

    Args:
        text: the document.
        source: what errors call it.
        directory: where relative file names start, if anywhere.
        mesh_dirs: where else mesh files and packages are.

    Raises:
        RigError: the document is malformed.
    """
    root = parse(text, source)
    if root.tag != "robot":
        raise RigError(source, root.sourceline, f"<{root.tag}>", "is not a URDF", "its root element must be <robot>")
    return _Reader(Node(root, Place(source, "", root.sourceline)), source, directory, mesh_dirs).read()


class _Reader:
    def __init__(self, robot: Node, source: str, directory: Path | None, mesh_dirs: Sequence[Path]):
        self.robot = robot
        self.source = source
        self.directory = directory
        self.mesh_dirs = mesh_dirs
        self.missing: dict[str, Place] = {}
        self.colors: dict[str, Color] = {}
        self.builder = RigBuilder(robot.text("name") or Path(source).stem, source)
        self.builder.place = replace(robot.place, element="<robot>")

    def read(self) -> RigBuilder:
        check_expanded(self.robot)
        self._check_version()
        self._note_strangers("robot", [self.robot])
        for material in self.robot.children("material"):
            color = material.child("color")
            if color and material.text("name"):
                self.colors[material.need_text("name")] = self._rgba(color)
        links, joints = self._named("link"), self._named("joint")
        self._note_strangers("link", links)
        self._note_strangers("joint", joints)
        for link in links:
            self._link(link)
        for joint in joints:
            self._joint(joint)
        read_constraints(self.robot, self.builder)
        read_collisions(self.robot, self.builder)
        if self.missing:
            names = ", ".join(self.missing)
            place = next(iter(self.missing.values()))
            place.warn(f"mesh files not found: {names}", "name their directories in mesh_dirs; dynamics do not need them")
        return self.builder

    def _check_version(self) -> None:
        version = self.robot.text("version") or "1.0"
        if version not in ("1.0", "1.1", "1.2", "1"):
            self.robot.place.warn(f"is URDF version {version}; versions 1.0 to 1.2 are known", "what is new in it is lost")

    def _named(self, tag: str) -> list[Node]:
        nodes = []
        for element in self.robot.element.iterchildren(tag):
            node = self.robot.inner(element, f"<{tag}>")
            name = node.need_text("name")
            nodes.append(self.robot.inner(element, f"{tag} {name!r}"))
        return nodes

    def _note_strangers(self, what: str, nodes: Iterable[Node]) -> None:
        for tag, count in count_strangers(nodes, _MEANINGFUL[what], _OF_OTHERS[what]).items():
            self.builder.ignored[tag] = self.builder.ignored.get(tag, 0) + count

    def _link(self, node: Node) -> None:
        mass, center, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        if inertial := node.child("inertial"):
            mass = inertial.need("mass").number("value")
            pose = origin_of(inertial)
            moments = inertial.need("inertia")
            xx, xy, xz, yy, yz, zz = (moments.number(key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
            R = pose[:3, :3]
            center = pose[:3, 3]
            with np.errstate(over="ignore", invalid="ignore"):  # too large a number is refused with the link
                inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
                inertia = 0.5 * (inertia + inertia.T)
        self.builder.link(
            node.need_text("name"),
            mass,
            center,
            inertia,
            [self._shape(shape) for shape in node.children("collision")],
            [self._shape(shape) for shape in node.children("visual")],
            place=node.place,
        )

    def _shape(self, node: Node) -> Shape:
        material = node.child("material")
        color = None
        if material:
            own = material.child("color")
            color = self._rgba(own) if own else self.colors.get(material.text("name") or "")
        return Shape(self._geometry(node.need("geometry")), origin_of(node), node.text("name") or "", color)

    def _geometry(self, node: Node) -> Geometry:
        found = list(node.element.iterchildren(etree.Element))
        known = [*PLAIN_SHAPES, "mesh"]
        if len(found) != 1 or found[0].tag not in known:
            names = ", ".join(str(element.tag) for element in found) or "nothing"
            raise node.place.error(f"holds {names}", f"give one of {', '.join(known)}")
        shape = node.inner(found[0])
        if shape.tag == "box":
            x, y, z = shape.numbers("size", 3)
            return Box((x, y, z))
        if shape.tag == "sphere":
            return Sphere(shape.number("radius"))
        if shape.tag == "mesh":
            return self._mesh(shape)
        make = Capsule if shape.tag == "capsule" else Cylinder
        return make(shape.number("radius"), shape.number("length"))

    def _mesh(self, node: Node) -> Mesh:
        filename = node.need_text("filename")
        words = (node.text("scale") or "1 1 1").split()
        x, y, z = node.numbers("scale", len(words) if len(words) == 1 else 3, (1.0, 1.0, 1.0)) * (3 if len(words) == 1 else 1)
        path = files.find(filename, self.directory, self.mesh_dirs, node.place)
        if path is None:
            self.missing.setdefault(filename, node.place)
        return Mesh(filename, (x, y, z), path)

    def _joint(self, node: Node) -> None:
        kind = node.need_text("type")
        kind = ALIASES.get(kind, kind)
        axis, axis2, dynamics, mimic = (node.child(tag) for tag in ("axis", "axis2", "dynamics", "mimic"))
        self.builder.joint(
            node.need_text("name"),
            kind,
            node.need("parent").need_text("link"),
            node.need("child").need_text("link"),
            pose=origin_of(node),
            axis=axis.numbers("xyz", 3) if axis else (1.0, 0.0, 0.0),
            axis2=axis2.numbers("xyz", 3) if axis2 else None,
            limits=self._limits(node, kind),
            damping=dynamics.number("damping", 0.0) if dynamics else 0.0,
            friction=dynamics.number("friction", 0.0) if dynamics else 0.0,
            armature=dynamics.number("armature", 0.0) if dynamics else 0.0,
            mimic=Mimic(mimic.need_text("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0))
            if mimic
            else None,
            place=node.place,
        )

    def _limits(self, node: Node, kind: str) -> Limits:
        limit, ball = node.child("limit"), self._swing_twist(node)
        if limit is None:
            if kind in ("revolute", "prismatic"):
                node.place.warn("has no <limit>", "it may move without end; say so with type continuous, or add limits")
            return Limits(ball=ball)
        lower, upper = limit.number("lower", -math.inf), limit.number("upper", math.inf)
        if kind in ("revolute", "prismatic"):
            if lower == upper == 0.0:
                limit.place.warn("lower and upper limit are both 0", "read as unlimited; make the joint fixed if it is")
                lower, upper = -math.inf, math.inf
            elif limit.text("lower") is None and limit.text("upper") is None:
                limit.place.warn("gives no lower and upper limit", "read as unlimited")
        elif kind == "continuous":
            lower, upper = -math.inf, math.inf
        rates = {key: limit.number(key, math.inf) for key in ("velocity", "acceleration", "deceleration", "jerk")}
        return Limits(lower, upper, limit.number("effort", math.inf), **rates, ball=ball)

    def _swing_twist(self, node: Node) -> SwingTwist | None:
        given = node.child(SWING_TWIST)
        if given is None:
            return None
        known = SwingTwist()
        numbers = {name: given.numbers(name, len(value), value) for name, value in vars(known).items()}
        try:
            return SwingTwist(**numbers)  # type: ignore[arg-type]
        except ValueError as error:
            raise given.place.error(str(error)) from None

    def _rgba(self, node: Node) -> Color:
        r, g, b, a = node.numbers("rgba", 4)
        return (r, g, b, a)
