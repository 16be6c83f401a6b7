"""Draws README's second picture: a ragdoll that runs into the air above a flight of stairs.

python docs/pictures/make_tumble.py docs/pictures/tumble.png        (needs articulated[plot])
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np
from scipy.spatial import ConvexHull

import articulated as art

mpl.use("Agg")
import matplotlib.pyplot as plt

BODY, FORCE, STONE = "#1f4e79", "#c0392b", "#9a9a9a"
SHOWN = [0.0, 0.35, 0.65, 0.85, 5.0]
"""Moments that are drawn as figures [s]."""

RISE, RUN, COUNT = 0.17, 0.29, 8
NEWTONS = 1500.0
"""Of force, for an arrow of a metre."""


def main(target: str) -> None:
    rig = art.load("ragdoll", root="free")
    drives = art.PD(stiffness=15.0, damping=3.0)  # of one who does not quite give up
    stairs = art.Stairs(RISE, RUN, COUNT, start=(COUNT * RUN, 0.0, -COUNT * RISE), heading=np.pi)
    simulation = art.Simulation(rig, dt=0.002, ground=art.Ground(stairs, friction=0.6), actuation=drives)
    q, v = rig.neutral(), np.zeros(rig.nv)
    q[:3], v[:3] = (-0.6, 0.0, 1.05), (1.6, 0.0, 0.3)
    run = simulation.run(q, v, duration=5.0, fps=100, control=rig.neutral())
    fig = plt.figure(figsize=(11, 6.4), dpi=110, layout="constrained")
    grid = fig.add_gridspec(2, 2, height_ratios=[1.5, 1.0])
    draw_figures(fig.add_subplot(grid[0, :]), run)
    draw_forces(fig.add_subplot(grid[1, 0]), run)
    draw_energy(fig.add_subplot(grid[1, 1]), run)
    fig.savefig(target)


def draw_figures(ax, run: art.Trajectory) -> None:
    """Boxes and capsules at some moments, from the side, each a little lighter than the one after it."""
    edges = [(-1.6, 0.0), (0.0, 0.0)]
    for k in range(1, COUNT + 1):
        edges += [((k - 1) * RUN, -k * RISE), (k * RUN, -k * RISE)]
    edges.append((4.6, -COUNT * RISE))
    x, z = np.transpose(edges)
    ax.fill_between(x, z, -COUNT * RISE - 0.15, color=STONE, lw=0.0)
    for k, moment in enumerate(SHOWN):
        frame = int(np.argmin(np.abs(run.time - moment)))
        poses = art.link_poses(run.rig, run.q[frame])
        shade = 0.25 + 0.75 * k / (len(SHOWN) - 1)
        for link in run.rig.links.values():
            for collision in link.collisions:
                body = outline(poses[link.index] @ collision.pose, collision.geometry)
                ax.fill(*body.T, facecolor=BODY, alpha=shade, edgecolor="white", lw=0.4)
        for point, force in zip(run.contact_points[frame], run.contact_forces[frame], strict=True):
            if force @ force > 1.0:
                head = point + force / NEWTONS
                ax.annotate("", head[[0, 2]], point[[0, 2]], arrowprops={"arrowstyle": "->", "color": FORCE, "lw": 1.2})
        top = poses[run.rig.links["head"].index][:3, 3]
        ax.text(top[0], top[2] + 0.3, f"{moment:g} s", ha="center", fontsize=9)
    ax.set_aspect("equal")
    ax.set_title(f"{run.rig.name}: {run.rig.nv} degrees of freedom, {len(run.contact_links)} points of contact", fontsize=10)
    ax.axis("off")


def outline(X: np.ndarray, shape) -> np.ndarray:
    """A shape from the side, in x and z: a convex polygon."""
    if isinstance(shape, art.Box):
        corners = np.stack(np.meshgrid(*([-0.5, 0.5],) * 3), axis=-1).reshape(-1, 3) * shape.size
        points = corners @ X[:3, :3].T + X[:3, 3]
    else:
        turn = np.linspace(0.0, 2.0 * np.pi, 24)
        circle = shape.radius * np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=-1)
        half = 0.5 * getattr(shape, "length", 0.0) * X[:3, 2]
        points = np.concatenate([X[:3, 3] + half + circle, X[:3, 3] - half + circle])
    flat = points[:, [0, 2]]
    return flat[ConvexHull(flat).vertices]


def draw_forces(ax, run: art.Trajectory) -> None:
    weight = run.rig.mass * 9.81
    ax.plot(run.time, run.contact_forces[..., 2].sum(axis=-1) / weight, lw=1.2, color=FORCE)
    ax.axhline(1.0, color="k", lw=0.8, ls="--")
    ax.set_xlabel("time [s]")
    ax.set_ylabel("force of the ground [weights]")
    ax.grid(alpha=0.2)


def draw_energy(ax, run: art.Trajectory) -> None:
    ax.plot(run.time, run.kinetic_energy, label="kinetic", lw=1.2)
    ax.plot(run.time, run.potential_energy - run.potential_energy[-1], label="potential", lw=1.2)
    ax.plot(run.time, run.energy - run.energy[-1], "k--", label="sum", lw=1.2)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("energy [J]")
    ax.legend(fontsize=7, loc="upper right")
    ax.grid(alpha=0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
