"""Draws README's picture of a walk that is captured, pushed, fallen out of, and taken up again.

python docs/pictures/make_walk.py docs/pictures/walk.png        (needs articulated[plot,mocap])
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import matplotlib as mpl
import numpy as np
from scipy.spatial import ConvexHull

import articulated as art

mpl.use("Agg")
import matplotlib.pyplot as plt

CLIP = Path(__file__).resolve().parents[2] / "tests" / "data" / "cmu_12_01_walk.bvh"
BODY, CLIP_COLOR, PUSH = "#1f4e79", "#d9a441", "#c0392b"
SHOWN = [0.0, 0.6, 1.1, 1.6, 2.0, 2.5, 4.4, 5.3, 6.2, 7.0]
"""Moments that are drawn [s]."""
SPACE = 0.95
"""Between figures [m]: they are drawn side by side, not where they are."""


def main(target: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", art.RigWarning)
        rig, walk = art.from_bvh(CLIP)
    walk = art.grounded(walk.part(0.1))
    drives = art.tuned(rig, frequency=6.0, limit=400.0, help=3.0)
    simulation = art.Simulation(rig, dt=0.005, ground=True, actuation=drives)
    tracker, pushes = art.Tracker(simulation, walk), art.Pushes(rig)
    pushes.add("Spine1", (150.0, 250.0, 0.0), start=1.0, duration=0.1)
    tracker.set("limp", at=1.05, over=0.1)
    tracker.aim(walk, at=4.0, over=1.5, start=0.5, here=True)
    tracker.set("driven", at=4.0, over=1.2)
    run = simulation.run(walk.q[0], walk.v[0], duration=7.2, fps=100, control=tracker, external=pushes)

    fig, axes = plt.subplots(2, 1, figsize=(11, 5.0), dpi=110, layout="constrained", height_ratios=[1.5, 1.0])
    draw_figures(axes[0], run)
    draw_errors(axes[1], run, walk, tracker)
    fig.savefig(target)


def draw_figures(ax, run: art.Trajectory) -> None:
    rig = run.rig
    ax.axhline(0.0, color="#9a9a9a", lw=1.0)
    for k, moment in enumerate(SHOWN):
        frame = int(np.argmin(np.abs(run.time - moment)))
        X = art.link_poses(rig, run.q[frame])
        shift = k * SPACE - run.q[frame, 0]
        for link in rig.links.values():
            for shape in link.collisions:
                body = outline(X[link.index] @ shape.pose, shape.geometry)
                ax.fill(body[:, 0] + shift, body[:, 1], facecolor=BODY, edgecolor="white", lw=0.4)
        ax.text(k * SPACE, 1.85, f"{moment:g} s", ha="center", fontsize=8)
    first = SHOWN.index(1.1) * SPACE
    ax.annotate("", (first - 0.1, 1.25), (first - 0.6, 1.25), arrowprops={"arrowstyle": "-|>", "color": PUSH, "lw": 2.0})
    for at, text in ((0.5, "the clip, tracked"), (3.0, "pushed, limp"), (7.0, "helped up, and on with it")):
        ax.text(at * SPACE, -0.25, text, ha="center", fontsize=9)
    ax.set_aspect("equal")
    ax.axis("off")


def outline(X: np.ndarray, shape) -> np.ndarray:
    """A sphere or capsule from the side."""
    turn = np.linspace(0.0, 2.0 * np.pi, 20)
    circle = shape.radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    half = 0.5 * getattr(shape, "length", 0.0) * X[[0, 2], 2]
    points = np.concatenate([X[[0, 2], 3] + half + circle, X[[0, 2], 3] - half + circle])
    return points[ConvexHull(points).vertices]


def draw_errors(ax, run: art.Trajectory, walk: art.Motion, tracker: art.Tracker) -> None:
    rig, off = run.rig, []
    wanted = np.where((run.time < 4.0)[:, None], walk.at(run.time), walk.at(run.time - 3.5))
    for joint in rig.joints.values():
        if joint.kind == "ball":
            dots = np.abs(np.sum(run.q[:, joint.q_slice] * wanted[:, joint.q_slice], axis=-1))
            off.append(2.0 * np.degrees(np.arccos(np.clip(dots, 0.0, 1.0))))
    ax.plot(run.time, np.mean(off, axis=0), color=BODY, lw=1.3, label="mean joint error [degrees]")
    torque = np.abs(run.tau[:, 6:]).max(axis=-1)
    ax.plot(run.time, torque / 10.0, color=CLIP_COLOR, lw=0.9, label="largest joint torque [10 N m]")
    ax.axvspan(1.0, 1.1, color=PUSH, alpha=0.4, lw=0.0)
    ax.axvspan(1.1, 4.0, color="#9a9a9a", alpha=0.15, lw=0.0)
    ax.set_xlabel("time [s]")
    ax.set_xlim(0.0, run.time[-1])
    ax.legend(fontsize=8, loc="upper right")
    ax.grid(alpha=0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
