"""Draws README's picture from the trajectory that README's first command writes:

python docs/pictures/make_fall.py fall.npz docs/pictures/fall.png        (needs articulated[plot])
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np

import articulated as art

mpl.use("Agg")
import matplotlib.pyplot as plt

BONES = "#1f4e79"
SHOWN = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 2.0, 5.0]
"""Moments that are drawn as figures [s]."""

APART = 1.35
"""From one figure to the next [m]."""


def main(source: str, target: str) -> None:
    run = art.Trajectory.load(source)
    fig = plt.figure(figsize=(11, 5.6), dpi=110, layout="constrained")
    grid = fig.add_gridspec(2, 2, height_ratios=[1.25, 1.0])
    draw_figures(fig.add_subplot(grid[0, :]), run)
    draw_angles(fig.add_subplot(grid[1, 0]), run)
    draw_energy(fig.add_subplot(grid[1, 1]), run)
    fig.savefig(target)


def draw_figures(ax, run: art.Trajectory) -> None:
    """Bones at some moments, side by side, seen half from the side; the rig's x axis is ahead, its y axis is up."""
    for k, moment in enumerate(SHOWN):
        frame = int(np.argmin(np.abs(run.time - moment)))
        poses = art.link_poses(run.rig, run.q[frame])
        for bone in bones(run.rig, poses):
            x, y, z = np.transpose(bone)
            ax.plot(k * APART + 0.75 * x + 0.65 * z, y, color=BONES, lw=2.4, solid_capstyle="round")
        ax.text(k * APART, 1.0, f"{moment:g} s", ha="center", fontsize=9)
    ax.set_aspect("equal")
    ax.set_ylim(-1.5, 1.15)
    ax.set_title(f"{run.rig.name}: {run.rig.nv} degrees of freedom, hung up by the pelvis and let go", fontsize=10)
    ax.axis("off")


def bones(rig: art.Rig, poses: np.ndarray):
    """Segments from each joint to the next; and where a chain ends, twice the way to the last link's centre of mass."""
    parents = {joint.child: joint.parent for joint in rig.joints.values()}
    for link in rig.links.values():
        at = poses[link.index]
        if link.name in parents:
            yield poses[rig.links[parents[link.name]].index][:3, 3], at[:3, 3]
        if link.name not in parents.values():
            yield at[:3, 3], (at @ np.append(2.0 * link.center, 1.0))[:3]


def draw_angles(ax, run: art.Trajectory) -> None:
    for name in ("left_shoulder_X", "left_hip_Z", "left_knee_Z"):
        ax.plot(run.time, np.degrees(run.q[:, run.rig.joints[name].q_slice]), label=name.replace("_", " "), lw=1.4)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("angle [°]")
    ax.legend(fontsize=7, loc="upper right")
    ax.grid(alpha=0.2)


def draw_energy(ax, run: art.Trajectory) -> None:
    ax.plot(run.time, run.kinetic_energy, label="kinetic", lw=1.2)
    ax.plot(run.time, run.potential_energy - run.potential_energy[0], label="potential", lw=1.2)
    ax.plot(run.time, run.work, label="work of damping", lw=1.2)
    ax.plot(run.time, run.energy - run.energy[0] - run.work, "k--", label="balance", lw=1.2)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("energy [J]")
    ax.legend(fontsize=7, loc="center right")
    ax.grid(alpha=0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
