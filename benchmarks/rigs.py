"""What is run: robots of example-robot-data, and chains of any length."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import articulated as art

warnings.simplefilter("ignore", art.RigWarning)

ROBOTS = {
    "UR5": ("ur_description/urdf/ur5_robot.urdf", "fixed"),
    "Panda": ("panda_description/urdf/panda.urdf", "fixed"),
    "Solo12": ("solo_description/robots/solo12.urdf", "free"),
    "G1": ("g1_description/urdf/g1_29dof_rev_1_0.urdf", "free"),
    "Talos": ("talos_data/robots/talos_reduced.urdf", "free"),
    "human": ("human_description/robots/human.urdf", "free"),
}


def robot(name: str) -> art.Rig:
    """A robot; joints that follow others move on their own, since Pinocchio's ABA has them so."""
    path, root = ROBOTS[name]
    rig = art.load(f"package://example-robot-data/robots/{path}", root)
    if all(joint.mimic is None for joint in rig.joints.values()):
        return rig
    return art.load(re.sub(r"<mimic[^>]*/>", "", Path(rig.source).read_text()), root)


def chain(links: int) -> art.Rig:
    """Links of 0.2 m on hinges that turn about x and y by turns, hanging from the world."""
    builder = art.RigBuilder(f"chain{links}")
    builder.link("l0")
    for k in range(1, links + 1):
        builder.link(f"l{k}", 0.5, (0.0, 0.01, -0.1), (2e-3, 2e-3, 1e-4))
        axis = (1.0, 0.0, 0.0) if k % 2 else (0.0, 1.0, 0.0)
        builder.joint(f"j{k}", "revolute", f"l{k - 1}", f"l{k}", xyz=(0.0, 0.0, 0.0 if k == 1 else -0.2), axis=axis)
    return builder.build()
