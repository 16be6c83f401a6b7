"""What swings."""

from __future__ import annotations

import articulated as art
from makers.maker import BLUE, DARK, RED, Maker, box, rod
from makers.plain_maker import PlainMaker


def pendulum() -> art.RigBuilder:
    """Two rods on ball joints, swinging freely in space"""
    b = PlainMaker("pendulum")
    b.link("pivot", 1.0, inertia=(0.01, 0.01, 0.01))
    b.round("upper", 1.0, art.Capsule(0.03, 0.44), (0, 0, -0.25))
    b.round("lower", 1.0, art.Capsule(0.03, 0.44), (0, 0, -0.25))
    b.joint("shoulder", "ball", "pivot", "upper")
    b.joint("elbow", "ball", "upper", "lower", xyz=(0, 0, -0.5))
    return b


def cartpole() -> art.RigBuilder:
    """A cart on a rail with a pole to balance"""
    b = PlainMaker("cartpole")
    b.link("rail", 5.0, inertia=(0.01, 10.0, 10.0))
    b.box("cart", 1.0, (0.3, 0.2, 0.1))
    b.round("pole", 0.1, art.Cylinder(0.02, 1.0), (0, 0, 0.5))
    b.joint("slide", "prismatic", "rail", "cart", axis=(1, 0, 0), limits=art.Limits(-2.4, 2.4, effort=10.0))
    b.joint("hinge", "continuous", "cart", "pole", axis=(0, 1, 0))
    return b


def double_pendulum() -> art.RigBuilder:
    """Two rods on hinges: chaos in a plane"""
    b = Maker("double_pendulum")
    b.part("mount", 5.0, [box((0.3, 0.3, 0.06), (0, 0, 0.03), DARK)])
    hinge = {"axis": (0, 1, 0), "damping": 0.001}
    b.part(
        "upper",
        1.0,
        [rod((0, 0, -0.03), (0, 0, -0.47), 0.03, BLUE)],
        "continuous",
        "mount",
        (0, 0, 0),
        joint="shoulder",
        **hinge,
    )
    b.part(
        "lower",
        1.0,
        [rod((0, 0, -0.53), (0, 0, -0.97), 0.03, RED)],
        "continuous",
        "upper",
        (0, 0, -0.5),
        joint="elbow",
        **hinge,
    )
    return b
