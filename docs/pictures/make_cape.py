"""Draws README's third picture: someone with a cape and a ponytail is pushed, and falls.

python docs/pictures/make_cape.py docs/pictures/cape.png        (needs articulated[plot])
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np
from scipy.spatial import ConvexHull

import articulated as art
from articulated import particles as ap

mpl.use("Agg")
import matplotlib.pyplot as plt

BODY, CAPE, HAIR = "#1f4e79", "#c0392b", "#5b3a1e"
SHOWN = [0.0, 0.25, 0.5, 0.75, 1.5]
"""Moments that are drawn as figures [s]."""
APART = 1.15
"""From one figure to the next, besides where they are [m]."""
TURNED, RAISED = np.radians(35.0), np.radians(18.0)
CAMERA = np.array(
    [
        [np.cos(TURNED), -np.sin(TURNED), 0.0],
        [np.sin(RAISED) * np.sin(TURNED), np.sin(RAISED) * np.cos(TURNED), np.cos(RAISED)],
        [-np.cos(RAISED) * np.sin(TURNED), -np.cos(RAISED) * np.cos(TURNED), np.sin(RAISED)],
    ]
)
"""Right, up, and towards who looks."""


def main(target: str) -> None:
    rig = art.load("ragdoll", root="free")
    drives = art.PD(stiffness=60.0, damping=4.0)
    simulation = art.Simulation(
        rig, dt=0.004, ground=art.Ground(friction=0.8), actuation=drives, particles=[cape(), ponytail()]
    )
    q, v = rig.neutral(), np.zeros(rig.nv)
    q[2], v[:3], v[4] = 1.02, (1.8, 0.0, 0.4), 0.8
    run = simulation.run(q, v, duration=1.5, fps=100, control=rig.neutral())
    fig, ax = plt.subplots(figsize=(11, 3.9), dpi=110, layout="constrained")
    draw(ax, run)
    fig.savefig(target)


def cape() -> ap.Attached:
    """Of wool, on both shoulders, in a wind from the side."""
    cloth = ap.grid_cloth(
        (-0.12, -0.22, 0.44), (-0.12, 0.0, -0.95), (0.0, 0.44, 0.0), 22, 12, 0.9, 300.0, bending=1e-4, damping=2e-3
    )
    forces = [*cloth.forces, ap.TriangleWind(cloth.triangles, 0.5, (0.0, 1.5, 0.0))]
    shoulders = [*range(4), *range(8, 12)]
    return ap.Attached(cloth.x, cloth.mass, forces, {"torso": shoulders}, "torso", (), BEHIND, friction=0.3)


BEHIND = ["torso", "pelvis", "left_thigh", "right_thigh", "left_shin", "right_shin"]


def ponytail() -> ap.Attached:
    """Twenty strands."""
    turn = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
    roots = np.stack([np.full(20, -0.1), 0.02 * np.cos(turn), 0.16 + 0.02 * np.sin(turn)], axis=1)
    return ap.hair_on("head", roots, (-1.0, 0.0, 0.2), 0.4, 14, 0.01, 500.0, 1e-6, 0.5, 2e-4, avoids=["head", "torso"])


def draw(ax, run: art.Trajectory) -> None:
    """Figures as seen from behind and above, what is nearer over what is farther."""
    strands, triangles = run.particles.segments[-20 * 13 :], run.particles.triangles
    for k, moment in enumerate(SHOWN):
        frame = int(np.argmin(np.abs(run.time - moment)))
        x, shift = run.particles.x[frame] @ CAMERA.T, np.array([k * APART, 0.0])
        things = []
        for link, X in zip(run.rig.links.values(), art.link_poses(run.rig, run.q[frame]), strict=True):
            for collision in link.collisions:
                shape = corners(X @ collision.pose, collision.geometry) @ CAMERA.T
                flat = shape[:, :2]
                things.append((shape[:, 2].mean(), flat[ConvexHull(flat).vertices], BODY, "white"))
        cloth = x[triangles]
        n = np.cross(cloth[:, 1] - cloth[:, 0], cloth[:, 2] - cloth[:, 0])
        light = 0.4 + 0.6 * np.abs(n[:, 2]) / np.linalg.norm(n, axis=1)
        for triangle, shade in zip(cloth, light, strict=True):
            colour = tuple(shade * np.array(mpl.colors.to_rgb(CAPE)))
            things.append((triangle[:, 2].mean() + 0.1, triangle[:, :2], colour, colour))
        for depth, outline, face, edge in sorted(things, key=lambda thing: thing[0]):
            ax.fill(*(outline + shift).T, facecolor=face, edgecolor=edge, lw=0.4, zorder=depth + 10.0)
        for some in x[strands]:
            ax.plot(*(some[:, :2] + shift).T, color=HAIR, lw=1.0, zorder=some[:, 2].mean() + 10.05)
        ax.text(*(x[-1, :2] + shift + (0.1, 0.45)), f"{moment:g} s", ha="center", fontsize=9, zorder=99)
    ax.set_aspect("equal")
    ax.set_title(f"{run.rig.name}, {run.particles.x.shape[1]} particles, one solution", fontsize=10)
    ax.axis("off")


def corners(X: np.ndarray, shape) -> np.ndarray:
    """Points whose convex hull is a box or, nearly, a capsule."""
    if isinstance(shape, art.Box):
        points = np.stack(np.meshgrid(*([-0.5, 0.5],) * 3), axis=-1).reshape(-1, 3) * shape.size
    else:
        turn, up = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 16), np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9))
        ball = np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)], axis=-1).reshape(-1, 3)
        half = np.array([0.0, 0.0, 0.5 * shape.length])
        points = np.concatenate([shape.radius * ball + half, shape.radius * ball - half])
    return points @ X[:3, :3].T + X[:3, 3]


if __name__ == "__main__":
    main(*sys.argv[1:])
