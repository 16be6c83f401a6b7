"""The frozen description of a rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from articulated.rig.joint import KINDS, Joint
from articulated.rig.loop import Loop
from articulated.rig.shapes import Shape
from articulated.rig.skeleton import Skeleton
from articulated.rig.swing_twist import random_turn

_ENDLESS = 1e6
"""A position limit beyond this [rad or m] is a file's way to say that there is none."""


@dataclass(frozen=True, eq=False)
class Link:
    """A frame of the rig, with what its source says of it.

    Attributes:
        name, index: its name, and its place on the link axis of `link_poses` and `external`.
        body: index of the body that it is part of; -1 if it is fixed to the world.
        pose: the link's frame in the body's own, shape (4, 4) (the world's, where body is -1).
        joint: name of the joint, moving or fixed, by which it hangs; "" for the root.
        mass: its own mass [kg].
        center: its own centre of mass, in the link frame, shape (3,) [m].
        inertia: its own inertia about that centre, in link axes, shape (3, 3) [kg m²].
        collisions, visuals: its shapes.
    """

    name: str
    index: int
    body: int
    pose: np.ndarray
    joint: str
    mass: float
    center: np.ndarray
    inertia: np.ndarray
    collisions: tuple[Shape, ...] = ()
    visuals: tuple[Shape, ...] = ()


@dataclass(frozen=True, eq=False)
class FixedJoint:
    """A joint that makes two links one body; kept so that nothing of the source is lost.

    Attributes:
        name, parent, child: as in the source.
        pose: the child link's frame in the parent link's, shape (4, 4).
    """

    name: str
    parent: str
    child: str
    pose: np.ndarray


@dataclass(frozen=True, eq=False)
class Body:
    """Links that move as one, in a frame whose z axis is the axis of the joint that moves it.

    That frame shows nowhere outside: at the surface everything is in link frames or in the world.

    Attributes:
        name: the link that its joint moves.
        parent: index of the parent body, less than its own; -1 is the world.
        joint: name of the joint that moves it.
        pose: its frame in the parent body's when q is neutral, shape (4, 4).
        axis: the first axis of a universal joint, in this frame, shape (3,); else z.
        mass, center, inertia: of all its links, in this frame; the inertia about the centre of mass.
    """

    name: str
    parent: int
    joint: str
    pose: np.ndarray
    axis: np.ndarray
    mass: float
    center: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True, eq=False)
class Rig:
    """A tree of bodies and joints, in tree order; see `load` and `RigBuilder`.

    Two rigs are equal only if they are the same object. Arrays on a rig are read-only.

    Attributes:
        name: from its source.
        root: how its root link meets the world: "fixed", "free" or "planar".
        joints: moving joints by name, in tree order (each has q_slice, v_slice, kind, limits); followers too.
        links: links by name (each has .index into the link axis of `link_poses`).
        fixed_joints: the joints that merged links, by name.
        bodies: what moves, parents first.
        source: the file it came from, or "".
        ignored: elements of the source that mean nothing to a simulation, counted by name.
        loops: what joins its links besides joints, if its source says; a `Simulation` closes these.
        disabled_collisions: pairs of links that may not collide, by name, each pair in the order of `links`, and the pairs too.
        skeleton: of the BVH file that it came from, for motions to be written as such a file; None if it did not.
        nq, nv: length of a configuration, and of a generalized velocity: the number of degrees of freedom.
    """

    name: str
    root: str
    joints: Mapping[str, Joint]
    links: Mapping[str, Link]
    fixed_joints: Mapping[str, FixedJoint]
    bodies: tuple[Body, ...]
    source: str
    ignored: Mapping[str, int]
    loops: tuple[Loop, ...] = ()
    disabled_collisions: tuple[tuple[str, str], ...] = ()
    skeleton: Skeleton | None = field(default=None, repr=False)
    nq: int = field(init=False)
    nv: int = field(init=False)

    def __repr__(self) -> str:
        return f"Rig({self.name!r}, root={self.root!r}, nq={self.nq}, nv={self.nv}, nbodies={len(self.bodies)})"

    def __post_init__(self):
        object.__setattr__(self, "nq", sum(joint.nq for joint in self.joints.values()))
        object.__setattr__(self, "nv", sum(joint.nv for joint in self.joints.values()))

    @property
    def nlinks(self) -> int:
        return len(self.links)

    @property
    def mass(self) -> float:
        """The mass of everything that moves [kg]; links fixed to the world do not count."""
        return sum(body.mass for body in self.bodies)

    @property
    def armature(self) -> np.ndarray:
        """Reflected rotor inertia, shape (nv,) [kg m² or kg]; a follower's counts at its leader, times its ratio squared."""
        return self._per_coordinate(lambda joint: joint.armature, lambda ratio: ratio * ratio)

    @property
    def damping(self) -> np.ndarray:
        """Viscous joint damping, shape (nv,) [N m s/rad or N s/m]; followers as in `armature`."""
        return self._per_coordinate(lambda joint: joint.damping, lambda ratio: ratio * ratio)

    @property
    def friction(self) -> np.ndarray:
        """Dry joint friction, shape (nv,) [N m or N]; a follower's counts at its leader, times the size of its ratio."""
        return self._per_coordinate(lambda joint: joint.friction, abs)

    @property
    def lower(self) -> np.ndarray:
        """Lower position limits, shape (nv,); -inf where there is none (always for ball, planar and floating joints)."""
        return self._position_limit(lambda joint: joint.limits.lower, -math.inf)

    @property
    def upper(self) -> np.ndarray:
        """Upper position limits, shape (nv,); inf where there is none (always for ball, planar and floating joints)."""
        return self._position_limit(lambda joint: joint.limits.upper, math.inf)

    @property
    def quaternions(self) -> dict[str, slice]:
        """Where the quaternions (xyzw) of ball and floating joints stand in q, by joint."""
        return {
            joint.name: slice(joint.q_slice.stop - 4, joint.q_slice.stop)
            for joint in self.joints.values()
            if joint.nq > joint.nv
        }

    @property
    def q_names(self) -> list[str]:
        """A name for each entry of q: the joint's, with ".x" or the like where it has several."""
        return self._names(lambda kind: kind.q_names)

    @property
    def v_names(self) -> list[str]:
        """A name for each entry of v."""
        return self._names(lambda kind: kind.v_names)

    def neutral(self) -> np.ndarray:
        """The configuration with every joint at zero, shape (nq,)."""
        values = [KINDS[joint.kind].neutral for joint in self.joints.values() if not joint.mimic]
        return np.array([x for value in values for x in value], dtype=float)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Configurations within the limits, uniform in each coordinate.

        An angle without limits (or with limits beyond a million) is drawn from [-π, π], a length from [-1, 1] m, an orientation
        uniformly.

        Args:
            rng: a numpy generator, a seed, or None.
            size: leading shape of the result.

        Returns:
            Configurations, shape (*size, nq) [rad, m or unit quaternion].
        """
        rng = np.random.default_rng(rng)
        shape = (size,) if isinstance(size, int) else tuple(size)
        q = np.empty((*shape, self.nq))
        for joint in self.joints.values():
            if not joint.mimic:
                q[..., joint.q_slice] = _random_configuration(joint, rng, shape)
        return q

    def with_joints(self, **properties: float | Mapping[str, float]) -> Rig:
        """The same rig with other passive joint properties: most files give none.

            ragdoll = rig.with_joints(damping=0.5, armature={"left_wrist": 0.01})

        Args:
            properties: damping, friction or armature, each a number for all joints but the root's, or a mapping by name.

        Raises:
            ValueError: a property or a joint is unknown, or a number is negative or not finite.
        """
        joints = dict(self.joints)
        for what, given in properties.items():
            if what not in ("damping", "friction", "armature"):
                raise ValueError(f"unknown joint property {what!r}; expected damping, friction or armature")
            named = given if isinstance(given, Mapping) else {n: given for n, j in joints.items() if not self.is_root(j)}
            for name, value in named.items():
                if name not in joints:
                    raise ValueError(f"rig {self.name!r} has no moving joint {name!r}")
                if not (math.isfinite(value) and value >= 0.0):
                    raise ValueError(f"{what} of joint {name!r} is {value!r}; expected a finite number, zero or more")
                joints[name] = replace(joints[name], **{what: float(value)})
        return replace(self, joints=MappingProxyType(joints))

    def is_root(self, joint: Joint) -> bool:
        """Whether a joint lets a rig float or slide in the world, so that no motor and no bearing is there."""
        return joint.kind in ("floating", "planar") and (not joint.parent or self.links[joint.parent].body < 0)

    def to_urdf(self) -> str:
        """This rig as URDF text, from which `load` makes the same rig again (with the same `root`)."""
        from articulated.rig.urdf.writer import urdf_text

        return urdf_text(self)

    def _per_coordinate(self, value: Callable[[Joint], float], reflect: Callable[[float], float]) -> np.ndarray:
        result = np.zeros(self.nv)
        for joint in self.joints.values():
            if joint.mimic:
                leader = self.joints[joint.mimic.joint]
                result[leader.v_slice] += reflect(joint.mimic.multiplier) * value(joint)
            else:
                result[joint.v_slice] += value(joint)
        return result

    def _position_limit(self, value: Callable[[Joint], float], unlimited: float) -> np.ndarray:
        result = np.full(self.nv, unlimited)
        for joint in self.joints.values():
            if not joint.mimic and joint.nq <= 2:
                result[joint.v_slice] = value(joint)
        return result

    def _names(self, names: Callable) -> list[str]:
        return [
            f"{joint.name}.{suffix}" if suffix else joint.name
            for joint in self.joints.values()
            if not joint.mimic
            for suffix in names(KINDS[joint.kind])
        ]


def _random_configuration(joint: Joint, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    limits = joint.limits
    if joint.kind == "ball":
        if limits.ball is not None:
            return random_turn(limits.ball, rng, shape)
        if limits.upper < math.pi:
            return _random_turn(rng, shape, limits.upper)
        return _random_quaternion(rng, shape)
    if joint.kind == "floating":
        return np.concatenate([rng.uniform(-1.0, 1.0, (*shape, 3)), _random_quaternion(rng, shape)], axis=-1)
    if joint.kind == "planar":
        return rng.uniform([-1.0, -1.0, -math.pi], [1.0, 1.0, math.pi], (*shape, 3))
    reach = 1.0 if joint.kind == "prismatic" else math.pi
    lower, upper = limits.lower, limits.upper
    if lower < -_ENDLESS:
        lower = min(-reach, upper - reach)
    if upper > _ENDLESS:
        upper = max(reach, lower + reach)
    return rng.uniform(lower, upper, (*shape, joint.nq))


def _random_quaternion(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    quat_xyzw = rng.normal(size=(*shape, 4))
    return quat_xyzw / np.linalg.norm(quat_xyzw, axis=-1, keepdims=True)


def _random_turn(rng: np.random.Generator, shape: tuple[int, ...], largest: float) -> np.ndarray:
    axis = rng.normal(size=(*shape, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    half = 0.5 * rng.uniform(0.0, largest, (*shape, 1))
    return np.concatenate([axis * np.sin(half), np.cos(half)], axis=-1)
