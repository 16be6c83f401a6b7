"""The kinds of joints: one a file, all with the methods of `JointModel`."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.joints.ball import Ball
from articulated.dynamics.joints.floating import Floating
from articulated.dynamics.joints.joint import JointModel
from articulated.dynamics.joints.planar import Planar
from articulated.dynamics.joints.prismatic import Prismatic
from articulated.dynamics.joints.revolute import Revolute
from articulated.dynamics.joints.universal import Universal

_PLAIN = {
    "revolute": Revolute(),
    "continuous": Revolute(),
    "prismatic": Prismatic(),
    "ball": Ball(),
    "planar": Planar(),
    "floating": Floating(),
}


def joint_model(kind: str, axis: Sequence[float]) -> JointModel:
    """The model of a kind; `axis` is the first axis of a universal joint, in its body's frame."""
    return Universal(axis) if kind == "universal" else _PLAIN[kind]


__all__ = ["Ball", "Floating", "JointModel", "Planar", "Prismatic", "Revolute", "Universal", "joint_model"]
