"""Draws every shipped rig.

python docs/pictures/make_rigs_picture.py docs/pictures/rigs.png        (needs articulated[plot])
"""

from __future__ import annotations

import sys
import textwrap

import matplotlib as mpl
import numpy as np
from scipy.spatial import ConvexHull

import articulated as art
from articulated.rig.load import shipped_lines

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection

COLUMNS = 4
TURNED, RAISED = np.radians(38.0), np.radians(20.0)
CAMERA = np.array(
    [
        [-np.sin(TURNED), np.cos(TURNED), 0.0],
        [-np.sin(RAISED) * np.cos(TURNED), -np.sin(RAISED) * np.sin(TURNED), np.cos(RAISED)],
        [np.cos(RAISED) * np.cos(TURNED), np.cos(RAISED) * np.sin(TURNED), np.sin(RAISED)],
    ]
)
"""Right, up, and towards who looks."""
LIGHT = np.array([0.35, 0.75, 1.0]) / np.linalg.norm([0.35, 0.75, 1.0])
GROUND, SHADOW = "#eceae4", "#d2cfc6"
PALETTE = ["#1f4e79", "#c0392b", "#8aa1b4", "#d9a02b", "#5b7f5b", "#7b5d8c"]
"""Of links whose looks have no colour."""

HANGS = {"pendulum", "double_pendulum", "cartpole", "four_bar", "ponytail"}
"""What does not stand on the ground; there it is below."""

POSES = {
    "telescope": {"luff": 0.6, "extend": 2.2, "slew": 0.35, "chain_joint1": (0.0, -np.sin(-0.3), 0.0, np.cos(0.3))},
    "double_pendulum": {"shoulder": -0.7, "elbow": -0.9},
    "pendulum": {"shoulder": (0.25, 0.3, 0.0, np.sqrt(1.0 - 0.1525)), "elbow": (-0.4, 0.1, 0.0, np.sqrt(1.0 - 0.17))},
    "cartpole": {"slide": 0.3, "hinge": 0.25},
    "car": {"steering": 7.0},
    "buggy": {"front_left_steering": 0.4},
    "ponytail": {f"hair{k}": (0.0, np.sin(0.09 - 0.012 * k), 0.0, np.cos(0.09 - 0.012 * k)) for k in range(1, 13)},
}


def main(target: str) -> None:
    about, names = shipped_lines(), list(art.shipped_rigs())
    rows = -(-len(names) // COLUMNS)
    fig, axes = plt.subplots(rows, COLUMNS, figsize=(11, 2.75 * rows), dpi=100)
    for ax in axes.flat:
        ax.axis("off")
    for ax, name in zip(axes.flat, names, strict=False):
        draw(ax, posed(name), name in HANGS)
        ax.set_title(name, fontsize=11, fontweight="bold", pad=2)
        ax.text(0.5, -0.01, textwrap.fill(about[name], 42), transform=ax.transAxes, ha="center", va="top", fontsize=7.5)
    fig.subplots_adjust(left=0.01, right=0.99, top=0.965, bottom=0.05, wspace=0.03, hspace=0.32)
    fig.savefig(target, pil_kwargs={"optimize": True})


def posed(name: str) -> list[tuple[np.ndarray, np.ndarray, object]]:
    """Faces of all that it looks like: corners, shape (n, 4, 3), normals, shape (n, 3), and a colour."""
    rig = art.load(name)
    q = rig.neutral()
    for joint, value in POSES.get(name, {}).items():
        q[rig.joints[joint].q_slice] = value
    if rig.loops:
        q = art.assemble(rig, q_guess=q, hold=list(POSES.get(name, {})))
    X, result = art.link_poses(rig, q), []
    for k, link in enumerate(rig.links.values()):
        for shape in link.visuals:
            corners, normals = faces(shape.geometry)
            Y = X[link.index] @ shape.pose
            color = shape.color or mpl.colors.to_rgba(PALETTE[k % len(PALETTE)])
            result.append((corners @ Y[:3, :3].T + Y[:3, 3], normals @ Y[:3, :3].T, color))
    return result


def faces(geometry) -> tuple[np.ndarray, np.ndarray]:
    """Quadrilaterals that cover a shape, and their outward normals."""
    if isinstance(geometry, art.Box):
        corners, normals = [], []
        cells = np.linspace(-0.5, 0.5, 6)
        for axis in range(3):
            for sign in (-0.5, 0.5):
                for a, b in zip(cells[:-1], cells[1:], strict=True):
                    for c, d in zip(cells[:-1], cells[1:], strict=True):
                        flat = np.array([[sign, a, c], [sign, b, c], [sign, b, d], [sign, a, d]])
                        corners.append(np.roll(flat, axis, axis=1) * geometry.size)
                        normals.append(np.roll([2.0 * sign, 0.0, 0.0], axis))
        return np.array(corners), np.array(normals)
    r, half = geometry.radius, 0.5 * getattr(geometry, "length", 0.0)
    if isinstance(geometry, art.Cylinder):
        profile = [(0.0, -half), (0.6 * r, -half), (r, -half), *((r, z) for z in np.linspace(-half, half, 5)[1:])]
        profile += [(0.6 * r, half), (0.0, half)]
    else:
        up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
        profile = [(r * np.cos(u), r * np.sin(u) + np.copysign(half, u)) for u in up if u < -1e-9]
        profile += [(r, z) for z in np.linspace(-half, half, 7 if half else 1)]
        profile += [(r * np.cos(u), r * np.sin(u) + half) for u in up if u > 1e-9]
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    ring, z = np.transpose(profile)
    grid = np.stack([np.outer(ring, np.cos(turn)), np.outer(ring, np.sin(turn)), np.outer(z, np.ones(25))], axis=-1)
    corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return corners[size[:, 0] > 1e-12], (normals / np.maximum(size, 1e-12))[size[:, 0] > 1e-12]


def draw(ax, shapes, hangs: bool) -> None:
    """What is nearer over what is farther, on the ground, with the shadow that it throws."""
    everything = np.concatenate([corners.reshape(-1, 3) for corners, _, _ in shapes])
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    floor = low[2] - (0.25 * size.max() if hangs else 0.0)
    middle = 0.5 * (everything.max(axis=0) + low)
    reach = 0.62 * max(size[0], size[1], 0.8 * size[2])
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * reach + [middle[0], middle[1], floor]
    ax.fill(*(square @ CAMERA.T)[:, :2].T, color=GROUND, lw=0.0)
    for corners, _, _ in shapes:
        points = corners.reshape(-1, 3)
        on_floor = points - np.outer((points[:, 2] - floor) / LIGHT[2], LIGHT)
        flat = (on_floor @ CAMERA.T)[:, :2]
        ax.fill(*flat[ConvexHull(flat).vertices].T, color=SHADOW, lw=0.0)
    polygons, depths, colors = [], [], []
    for corners, normals, color in shapes:
        seen = normals @ CAMERA[2] > 0.0
        brightness = 0.45 + 0.55 * np.clip(normals[seen] @ LIGHT, 0.0, None)
        view = corners[seen] @ CAMERA.T
        polygons.append(view[..., :2])
        depths.append(view[..., 2].mean(axis=1))
        colors.append(np.clip(brightness[:, None] * np.array(color[:3]), 0.0, 1.0))
    order = np.argsort(np.concatenate(depths))
    polygons, colors = np.concatenate(polygons)[order], np.concatenate(colors)[order]
    ax.add_collection(PolyCollection(list(polygons), facecolors=colors, edgecolors=colors, linewidths=0.3))
    ax.set_aspect("equal")
    ax.autoscale_view()


if __name__ == "__main__":
    main(*sys.argv[1:])
