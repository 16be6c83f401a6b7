"""Writes the rigs beside it: `python urdf/make_rigs.py`. Masses and inertias are those of solid shapes.

Sizes and masses of the ragdoll are near those of an adult of 1.75 m and 75 kg (Winter, Biomechanics and Motor Control of
Human Movement, table 4.1).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

import articulated as art

HERE = Path(__file__).resolve().parent


def at(xyz=(0.0, 0.0, 0.0), along=(0.0, 0.0, 1.0)) -> np.ndarray:
    """A pose at a point with z along a coordinate direction."""
    pose = np.eye(4)
    z = np.array(along, dtype=float)
    x = np.roll(z, 1)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = xyz
    return pose


def box_inertia(mass: float, size) -> np.ndarray:
    x, y, z = (s * s for s in size)
    return np.diag([y + z, x + z, x + y]) * mass / 12.0


def round_inertia(mass: float, radius: float, length: float, capped: bool) -> np.ndarray:
    """Of a solid cylinder along z, or of a capsule."""
    ball = 4.0 / 3.0 * math.pi * radius**3 if capped else 0.0
    tube = math.pi * radius**2 * length
    m_ball, m_tube = mass * ball / (ball + tube), mass * tube / (ball + tube)
    # a half ball's centre is 3/8 of the radius beyond the end of the tube
    across = m_tube * (length**2 / 12 + radius**2 / 4)
    across += m_ball * (0.4 * radius**2 + length**2 / 4 + 0.375 * length * radius)
    about = m_tube * radius**2 / 2 + m_ball * 0.4 * radius**2
    return np.diag([across, across, about])


class Maker(art.RigBuilder):
    """Adds links that are one solid shape."""

    def box(self, name: str, mass: float, size, center=(0.0, 0.0, 0.0)) -> None:
        shape = art.Shape(art.Box(tuple(size)), at(center))
        self.link(name, mass, center, box_inertia(mass, size), [shape], [shape])

    def round(self, name: str, mass: float, geometry, center=(0.0, 0.0, 0.0), along=(0.0, 0.0, 1.0)) -> None:
        shape = art.Shape(geometry, at(center, along))
        R = shape.pose[:3, :3]
        inertia = R @ round_inertia(mass, geometry.radius, geometry.length, isinstance(geometry, art.Capsule)) @ R.T
        self.link(name, mass, center, inertia, [shape], [shape])


def pendulum() -> art.RigBuilder:
    b = Maker("pendulum")
    b.link("pivot", 1.0, inertia=(0.01, 0.01, 0.01))
    b.round("upper", 1.0, art.Capsule(0.03, 0.44), (0, 0, -0.25))
    b.round("lower", 1.0, art.Capsule(0.03, 0.44), (0, 0, -0.25))
    b.joint("shoulder", "ball", "pivot", "upper")
    b.joint("elbow", "ball", "upper", "lower", xyz=(0, 0, -0.5))
    return b


def cartpole() -> art.RigBuilder:
    b = Maker("cartpole")
    b.link("rail", 5.0, inertia=(0.01, 10.0, 10.0))
    b.box("cart", 1.0, (0.3, 0.2, 0.1))
    b.round("pole", 0.1, art.Cylinder(0.02, 1.0), (0, 0, 0.5))
    b.joint("slide", "prismatic", "rail", "cart", axis=(1, 0, 0), limits=art.Limits(-2.4, 2.4, effort=10.0))
    b.joint("hinge", "continuous", "cart", "pole", axis=(0, 1, 0))
    return b


def ponytail() -> art.RigBuilder:
    b = Maker("ponytail")
    b.link("head", 4.5, inertia=[0.02, 0.02, 0.015], collisions=[art.Sphere(0.1)], visuals=[art.Sphere(0.1)])
    parent, place = "head", (-0.09, 0.0, 0.04)
    for k in range(12):
        radius = 0.018 - 0.001 * k
        b.round(f"lock{k + 1}", 0.02 - 0.001 * k, art.Capsule(radius, 0.04 - radius / 2), (0, 0, -0.02))
        b.joint(f"hair{k + 1}", "ball", parent, f"lock{k + 1}", xyz=place, damping=1e-4, armature=1e-6)
        parent, place = f"lock{k + 1}", (0.0, 0.0, -0.04)
    return b


def buggy() -> art.RigBuilder:
    b = Maker("buggy")
    b.box("chassis", 60.0, (1.2, 0.6, 0.25), (0, 0, 0.1))
    for end, x in (("front", 0.45), ("rear", -0.45)):
        for side, y in (("left", 0.4), ("right", -0.4)):
            hub = f"{end}_{side}_hub"
            b.box(hub, 1.0, (0.06, 0.06, 0.06))
            travel = art.Limits(-0.08, 0.08)
            b.joint(
                f"{end}_{side}_spring",
                "prismatic",
                "chassis",
                hub,
                xyz=(x, y, -0.05),
                axis=(0, 0, 1),
                limits=travel,
                damping=200.0,
            )
            if end == "front":
                carrier = f"{end}_{side}_knuckle"
                b.box(carrier, 0.5, (0.05, 0.05, 0.05))
                follow = None if side == "left" else art.Mimic("front_left_steering")
                b.joint(
                    f"{end}_{side}_steering",
                    "revolute",
                    hub,
                    carrier,
                    axis=(0, 0, 1),
                    limits=art.Limits(-0.6, 0.6),
                    mimic=follow,
                )
                hub = carrier
            wheel = f"{end}_{side}_wheel"
            b.round(wheel, 3.0, art.Cylinder(0.18, 0.12), along=(0, 1, 0))
            b.joint(f"{end}_{side}_axle", "continuous", hub, wheel, axis=(0, 1, 0), damping=0.02)
    return b


def ragdoll() -> art.RigBuilder:
    b = Maker("ragdoll")
    easy = {"damping": 2.0, "armature": 0.01}
    weak = {"damping": 0.2, "armature": 0.002}
    b.box("pelvis", 10.5, (0.18, 0.28, 0.16))
    b.box("torso", 26.0, (0.20, 0.32, 0.42), (0, 0, 0.23))
    b.round("head", 6.0, art.Capsule(0.09, 0.10), (0, 0, 0.14))
    b.joint("spine", "ball", "pelvis", "torso", xyz=(0, 0, 0.10), limits=art.Limits(upper=0.7), **easy)
    b.joint("neck", "ball", "torso", "head", xyz=(0, 0, 0.46), limits=art.Limits(upper=0.8), **easy)
    for side, y in (("left", 1.0), ("right", -1.0)):
        out = (0.0, y, 0.0)
        b.round(f"{side}_upper_arm", 2.1, art.Capsule(0.045, 0.21), (0, 0.15 * y, 0), out)
        b.round(f"{side}_forearm", 1.2, art.Capsule(0.038, 0.18), (0, 0.125 * y, 0), out)
        b.box(f"{side}_hand", 0.45, (0.08, 0.16, 0.03), (0, 0.09 * y, 0))
        b.joint(
            f"{side}_shoulder",
            "ball",
            "torso",
            f"{side}_upper_arm",
            xyz=(0, 0.19 * y, 0.38),
            limits=art.Limits(upper=2.2),
            **easy,
        )
        bend = art.Limits(0.0, 2.5)
        b.joint(
            f"{side}_elbow",
            "revolute",
            f"{side}_upper_arm",
            f"{side}_forearm",
            xyz=(0, 0.29 * y, 0),
            axis=(0, 0, -y),
            limits=bend,
            **easy,
        )
        wrist = {"axis": (1, 0, 0), "axis2": (0, 0, 1), "limits": art.Limits(-0.9, 0.9), **weak}
        b.joint(f"{side}_wrist", "universal", f"{side}_forearm", f"{side}_hand", xyz=(0, 0.26 * y, 0), **wrist)
        b.round(f"{side}_thigh", 7.5, art.Capsule(0.07, 0.27), (0, 0, -0.20))
        b.round(f"{side}_shin", 3.5, art.Capsule(0.05, 0.31), (0, 0, -0.20))
        b.box(f"{side}_foot", 1.1, (0.25, 0.09, 0.06), (0.06, 0, -0.045))
        b.joint(
            f"{side}_hip", "ball", "pelvis", f"{side}_thigh", xyz=(0, 0.09 * y, -0.05), limits=art.Limits(upper=1.9), **easy
        )
        b.joint(
            f"{side}_knee",
            "revolute",
            f"{side}_thigh",
            f"{side}_shin",
            xyz=(0, 0, -0.42),
            axis=(0, 1, 0),
            limits=art.Limits(0.0, 2.5),
            **easy,
        )
        ankle = {"axis": (0, 1, 0), "axis2": (1, 0, 0), "limits": art.Limits(-0.7, 0.7), **weak}
        b.joint(f"{side}_ankle", "universal", f"{side}_shin", f"{side}_foot", xyz=(0, 0, -0.43), **ankle)
    return b


def four_bar() -> art.RigBuilder:
    """A crank that turns, a rocker that swings, and a coupler between them: a closed loop."""
    b = Maker("four_bar")
    b.box("base", 1.0, (1.1, 0.02, 0.02), (0.5, 0, 0))
    crank, coupler, rocker, base = 0.3, 0.9, 0.7, 1.0
    angle = 1.0
    x, z = base - crank * math.cos(angle), -crank * math.sin(angle)
    r, direction = math.hypot(x, z), math.atan2(z, x)
    above = direction + math.acos((coupler**2 + r**2 - rocker**2) / (2 * coupler * r))
    swung = direction + math.pi - math.acos((rocker**2 + r**2 - coupler**2) / (2 * rocker * r))
    for name, length, mass in (("crank", crank, 1.0), ("coupler", coupler, 2.0), ("rocker", rocker, 1.5)):
        b.box(name, mass, (length, 0.03, 0.03), (0.5 * length, 0, 0))
    hinge = {"axis": (0, -1, 0)}
    b.joint("crank", "continuous", "base", "crank", rpy=(0, -angle, 0), **hinge)
    b.joint("coupler", "continuous", "crank", "coupler", xyz=(crank, 0, 0), rpy=(0, angle - above, 0), **hinge)
    b.joint("rocker", "continuous", "base", "rocker", xyz=(base, 0, 0), rpy=(0, -swung, 0), **hinge)
    b.loop(art.Loop("hinge", "coupler", (coupler, 0, 0), "rocker", (rocker, 0, 0), axis=(0, 1, 0), name="tip"))
    return b


MAKERS = [pendulum, cartpole, ponytail, buggy, ragdoll, four_bar]

if __name__ == "__main__":
    for make in MAKERS:
        (HERE / f"{make.__name__}.urdf").write_text(make().build().to_urdf())
        print(f"wrote {make.__name__}.urdf")
