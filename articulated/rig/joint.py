"""Joints as a rig describes them: kind, frames, limits and passive properties. What they do is in `dynamics/joints`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from articulated.rig.swing_twist import SwingTwist


class Kind(NamedTuple):
    """The coordinates of one kind of joint.

    Attributes:
        nq, nv: how many configuration and velocity coordinates it has.
        neutral: its configuration where child and joint frame coincide.
        q_names, v_names: a short name for each coordinate; "" for the one of a 1-dof joint.
    """

    nq: int
    nv: int
    neutral: tuple[float, ...]
    q_names: tuple[str, ...]
    v_names: tuple[str, ...]


_ONE = Kind(1, 1, (0.0,), ("",), ("",))
_QUAT = ("qx", "qy", "qz", "qw")
_TURN = ("wx", "wy", "wz")

KINDS: dict[str, Kind] = {
    "revolute": _ONE,
    "continuous": _ONE,
    "prismatic": _ONE,
    "universal": Kind(2, 2, (0.0, 0.0), ("1", "2"), ("1", "2")),
    "ball": Kind(4, 3, (0.0, 0.0, 0.0, 1.0), _QUAT, _TURN),
    "planar": Kind(3, 3, (0.0, 0.0, 0.0), ("x", "y", "angle"), ("vx", "vy", "w")),
    "floating": Kind(7, 6, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), ("x", "y", "z", *_QUAT), ("vx", "vy", "vz", *_TURN)),
}
"""Every kind of moving joint. "fixed" is not among them: it makes two links one body."""

ALIASES = {"spherical": "ball", "hinge": "revolute", "slide": "prismatic"}
"""Names that other tools give to these kinds."""


@dataclass(frozen=True)
class Limits:
    """What a joint may do. Infinite means unlimited.

    Attributes:
        lower, upper: position [rad or m]; each axis of a universal joint has the same; a ball joint may turn away from
            neutral by at most `upper`.
        ball: of a ball joint, instead of `upper`: a cone for its swing, and a range for its twist.
        effort: force or torque [N or N m].
        velocity, acceleration, deceleration, jerk: and its derivatives, per [s], [s²] and [s³].
    """

    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    deceleration: float = math.inf
    jerk: float = math.inf
    ball: SwingTwist | None = None


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: q = multiplier · q_joint + offset. It has no q or v of its own."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """A moving joint of a rig.

    Attributes:
        name, kind: its name, and one of `KINDS`.
        parent, child: names of the links that it joins; the parent of a root joint is "".
        body: index of the body that it moves.
        pose: the joint's frame in the parent link's, shape (4, 4); the child link stands there when q is neutral.
        axis, axis2: unit directions in the child link's frame at neutral; `axis2` of a universal joint only, which
            first turns about `axis`, fixed in the parent, then about `axis2`, fixed in the child.
        q_slice, v_slice: its coordinates in q and v; empty for a joint that follows another.
        limits: see `Limits`.
        damping: viscous [N m s/rad or N s/m], for each of its coordinates.
        friction: dry [N m or N], for each of its coordinates.
        armature: reflected rotor inertia [kg m² or kg], for each of its coordinates.
        mimic: which joint it follows, or None.
    """

    name: str
    kind: str
    parent: str
    child: str
    body: int
    pose: np.ndarray
    axis: np.ndarray
    axis2: np.ndarray | None
    q_slice: slice
    v_slice: slice
    limits: Limits
    damping: float
    friction: float
    armature: float
    mimic: Mimic | None

    @property
    def nq(self) -> int:
        return 0 if self.mimic else KINDS[self.kind].nq

    @property
    def nv(self) -> int:
        return 0 if self.mimic else KINDS[self.kind].nv
