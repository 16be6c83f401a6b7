"""Rigs from Python: the same description and the same checks as a file's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from articulated.rig.assembly import assemble
from articulated.rig.collisions import CollisionRule, disabled_pairs
from articulated.rig.description import JointDescription, LinkDescription, check_joint, check_link
from articulated.rig.errors import Place
from articulated.rig.fit import check_loop
from articulated.rig.frames import is_pose, pose_of, snapped
from articulated.rig.joint import ALIASES, Limits, Mimic
from articulated.rig.loop import Loop
from articulated.rig.rig import Rig
from articulated.rig.shapes import Geometry, Shape
from articulated.rig.weight import filled, scaled


class RigBuilder:
    """Collects links and joints, in any order, and builds a rig of them.

        builder = art.RigBuilder("pendulum")
        builder.link("base")
        builder.link("bob", mass=1.0, center=(0, 0, -1), inertia=(0.01, 0.01, 0.01))
        builder.joint("hinge", "revolute", "base", "bob", axis=(0, 1, 0))
        rig = builder.build()

    Siblings keep the order in which their joints were added.
    """

    def __init__(self, name: str = "rig", source: str = ""):
        """Start a rig of this name; `source` is the file that errors speak of."""
        self.name = name
        self.source = source
        self.place = Place(source or f"rig {name!r}")
        self.ignored: dict[str, int] = {}
        self._links: list[LinkDescription] = []
        self._joints: list[JointDescription] = []
        self._loops: list[tuple[Loop, Place]] = []
        self._collision_rules: list[CollisionRule] = []

    def link(
        self,
        name: str,
        mass: float = 0.0,
        center: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        collisions: Sequence[Shape | Geometry] = (),
        visuals: Sequence[Shape | Geometry] = (),
        *,
        place: Place | None = None,
    ) -> None:
        """Add a link.

        Args:
            name: unlike any other link's.
            mass: [kg]; 0 makes a mere frame.
            center: of mass, in the link frame, shape (3,) [m].
            inertia: about that centre, in link axes [kg m²]: shape (3, 3), or (3,) for a diagonal, or (6,) for
                xx, xy, xz, yy, yz, zz.
            collisions, visuals: shapes, or geometries at the link's origin.
            place: where it stands in a source, for errors.

        Raises:
            RigError: the mass, the inertia or a shape is impossible.
        """
        place = place or Place(self.source or f"rig {self.name!r}", f"link {name!r}")
        link = LinkDescription(
            name,
            _number(place, "mass", mass),
            _array(place, "center", center, (3,)),
            _inertia_matrix(place, inertia),
            tuple(shape if isinstance(shape, Shape) else Shape(shape) for shape in collisions),
            tuple(shape if isinstance(shape, Shape) else Shape(shape) for shape in visuals),
            place,
        )
        check_link(link)
        self._links.append(link)

    def joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        *,
        xyz: ArrayLike = (0.0, 0.0, 0.0),
        rpy: Sequence[float] | None = None,
        quat_xyzw: Sequence[float] | None = None,
        pose: ArrayLike | None = None,
        axis: ArrayLike = (1.0, 0.0, 0.0),
        axis2: ArrayLike | None = None,
        limits: Limits | None = None,
        damping: float = 0.0,
        friction: float = 0.0,
        armature: float = 0.0,
        mimic: Mimic | None = None,
        place: Place | None = None,
    ) -> None:
        """Add a joint.

        Args:
            name: unlike any other joint's.
            kind: "fixed", "revolute", "continuous", "prismatic", "universal", "ball", "planar" or "floating".
            parent, child: names of the links that it joins; they may be added later.
            xyz, rpy, quat_xyzw: the joint's frame in the parent link's [m, rad]; the child link stands there at neutral.
            pose: the same as a matrix, shape (4, 4), instead of these.
            axis: its direction in the joint frame; the normal of a planar joint; unused by ball, floating and fixed.
            axis2: the second axis of a universal joint.
            limits: see `Limits`.
            damping, friction, armature: viscous damping [N m s/rad or N s/m], dry friction [N m or N], reflected rotor
                inertia [kg m² or kg], the same for each of its coordinates.
            mimic: the joint that it follows, if any.
            place: where it stands in a source, for errors.

        Raises:
            RigError: an axis, a limit or a number is impossible, or the kind is unknown.
        """
        place = place or Place(self.source or f"rig {self.name!r}", f"joint {name!r}")
        joint = JointDescription(
            name,
            ALIASES.get(kind, kind),
            parent,
            child,
            pose_of(place, _array(place, "xyz", xyz, (3,)), rpy, quat_xyzw) if pose is None else _pose(place, pose),
            _array(place, "axis", axis, (3,)),
            None if axis2 is None else _array(place, "axis2", axis2, (3,)),
            limits or Limits(),
            _number(place, "damping", damping),
            _number(place, "friction", friction),
            _number(place, "armature", armature),
            mimic,
            place,
        )
        check_joint(joint)
        self._joints.append(joint)

    def loop(self, loop: Loop, *, place: Place | None = None) -> None:
        """Add a loop, which the rig's simulations close; its links may be added later.

        Raises:
            RigError: another loop has its name.
        """
        place = place or Place(self.source or f"rig {self.name!r}", str(loop))
        if any(loop.name == other.name for other, _ in self._loops):
            raise place.error("another loop has this name", "rename it")
        self._loops.append((loop, place))

    def disable_collisions(self, link1: str, link2: str | None = None, *, place: Place | None = None) -> None:
        """Keep two links, or a link and all others (None), from colliding; the links may be added later.

        Links that turn out not to exist are skipped, with a `RigWarning`. The last word on a pair counts.
        """
        self._rule(link1, link2, False, place)

    def enable_collisions(self, link1: str, link2: str | None = None, *, place: Place | None = None) -> None:
        """Let two links, or a link and all others (None), collide after all; see `disable_collisions`."""
        self._rule(link1, link2, True, place)

    def _rule(self, link1: str, link2: str | None, collide: bool, place: Place | None) -> None:
        what = f"{'enable' if collide else 'disable'}_collisions"
        place = place or Place(self.source or f"rig {self.name!r}", what)
        self._collision_rules.append(CollisionRule(link1, link2, collide, place))

    def build(
        self,
        root: str = "fixed",
        *,
        repair_inertia: bool = False,
        density: float | None = None,
        total_mass: float | None = None,
        repair_mesh: str | None = "hull",
    ) -> Rig:
        """The rig of these links and joints.

        Args:
            root: "fixed" to the world, "free" or "planar" (in the world's x-y plane).
            repair_inertia: replace an impossible inertia by the nearest possible one instead of refusing it.
            density: of links that have collision shapes but no mass [kg/m³]: they get that of these shapes, and a `RigWarning`
                names them. Links without collision shapes stay mere frames.
            total_mass: of everything that moves [kg]: all masses and inertias are multiplied alike to make it so, those of
                links fixed to the world too, which do not count in it (see `Rig.mass`).
            repair_mesh: what a collision mesh that bounds no solid weighs, if it has to; see `mass_properties`.

        Raises:
            RigError: they do not form a tree, a mimic leads nowhere, an inertia is impossible, a joint moves no mass, a loop
                does not fit, or a link cannot be weighed.
            ValueError: `root` is not one of these, the density or the mass is not a positive number, or nothing moves that
                could have this mass.
        """
        if root not in ("fixed", "free", "planar"):
            raise ValueError(f"root is {root!r}; expected 'fixed', 'free' or 'planar'")
        links = self._links if density is None else filled(self._links, density, repair_mesh, self.place)
        rig = assemble(self.name, self.place, links, self._joints, root, repair_inertia, self.source, self.ignored)
        for loop, place in self._loops:
            try:
                check_loop(rig, loop)
            except ValueError as error:
                raise place.error(str(error).removeprefix(f"{loop}: "), "correct the loop") from None
        if total_mass is not None:
            rig = scaled(rig, total_mass)
        loops = tuple(loop for loop, _ in self._loops)
        return replace(rig, loops=loops, disabled_collisions=disabled_pairs(tuple(rig.links), self._collision_rules))


def _number(place: Place, what: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise place.error(f"{what} is {value!r}", "give a number") from None


def _array(place: Place, what: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise place.error(f"{what} is {values!r}", f"give numbers, shape {shape}") from None
    if array.shape != shape:
        raise place.error(f"{what} has shape {array.shape}", f"give shape {shape}")
    return array


def _pose(place: Place, values: Any) -> np.ndarray:
    pose = _array(place, "pose", values, (4, 4))
    if not is_pose(pose):
        raise place.error("pose is not a rotation and a translation", "give a homogeneous matrix, last row 0 0 0 1")
    return snapped(pose)


def _inertia_matrix(place: Place, inertia: Any) -> np.ndarray:
    try:
        given = np.array(inertia, dtype=float)
    except (TypeError, ValueError):
        raise place.error(f"inertia is {inertia!r}", "give numbers, shape (3, 3), (3,) or (6,)") from None
    if given.shape == (3,):
        return np.diag(given)
    if given.shape == (6,):
        xx, xy, xz, yy, yz, zz = given
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return _array(place, "inertia", given, (3, 3))
