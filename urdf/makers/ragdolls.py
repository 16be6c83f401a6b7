"""A limp person. Sizes and masses are near those of an adult of 1.75 m and 75 kg (Winter, Biomechanics and Motor Control of
Human Movement, table 4.1).
"""

from __future__ import annotations

import articulated as art
from makers.plain_maker import PlainMaker


def ragdoll() -> art.RigBuilder:
    """A limp person, each joint with its range of motion"""
    b = PlainMaker("ragdoll")
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
