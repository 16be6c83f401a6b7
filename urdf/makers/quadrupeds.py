"""What walks on four legs. Sizes, masses and efforts are near those of small electric robots such as Unitree's A1: 12 kg."""

from __future__ import annotations

import math

import articulated as art
from makers.maker import BLUE, DARK, RUBBER, STEEL, Maker, ball, box, rod, tube

LENGTH, BENT = 0.2, 0.8
"""How long thigh and shin are [m], and how far a thigh points back where every joint is at zero [rad]."""


def quadruped() -> art.RigBuilder:
    """A robot dog: twelve hinges with efforts, feet that are spheres; stands where all are at zero"""
    b = Maker("quadruped")
    z = round(2.0 * LENGTH * math.cos(BENT) + 0.02, 6)
    trunk = [box((0.38, 0.16, 0.1), (0, 0, z), BLUE)]
    b.part("trunk", 6.0, trunk, at=(0, 0, z), looks=[box((0.06, 0.1, 0.07), (0.21, 0, z + 0.01), DARK)])
    for end, x in (("front", 0.18), ("rear", -0.18)):
        for side, y in (("left", 1.0), ("right", -1.0)):
            _leg(b, f"{end}_{side}", x, y, z)
    return b


def _leg(b: Maker, name: str, x: float, y: float, z: float) -> None:
    motor = {"damping": 0.2, "friction": 0.1, "armature": 0.005}
    inner, outer = 0.05 * y, 0.13 * y
    hip = [tube((x, 0.07 * y, z), (x, 0.11 * y, z), 0.045, DARK)]
    limits = art.Limits(-0.8, 0.8, effort=33.5, velocity=21.0)
    b.part(f"{name}_hip", 0.6, hip, "revolute", "trunk", (x, inner, z), axis=(1, 0, 0), limits=limits, **motor)
    back, down = round(LENGTH * math.sin(BENT), 6), round(LENGTH * math.cos(BENT), 6)
    knee, foot = (x - back, outer, z - down), (x, outer, z - 2.0 * down)
    limits = art.Limits(-1.8, 1.5, effort=33.5, velocity=21.0)
    thigh = [rod((x, outer, z), knee, 0.022, STEEL)]
    b.part(f"{name}_thigh", 0.7, thigh, "revolute", f"{name}_hip", (x, outer, z), axis=(0, 1, 0), limits=limits, **motor)
    limits = art.Limits(-1.1, 0.7, effort=33.5, velocity=21.0)
    shin = [rod(knee, (x, outer, z - 2.0 * down + 0.02), 0.012, STEEL)]
    b.part(
        f"{name}_shin",
        0.15,
        shin,
        "revolute",
        f"{name}_thigh",
        knee,
        joint=f"{name}_knee",
        axis=(0, 1, 0),
        limits=limits,
        **motor,
    )
    b.part(f"{name}_foot", 0.05, [ball(0.02, foot, RUBBER)], "fixed", f"{name}_shin", foot)
