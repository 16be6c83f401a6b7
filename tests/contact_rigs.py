"""Rigs that touch the ground, and how they start."""

from __future__ import annotations

import math

import numpy as np
from conftest import example_robots

import articulated as art

ROBOTS = {
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "human": "human_description/robots/human.urdf",
}


def chain(n: int) -> art.Rig:
    builder = art.RigBuilder("chain")
    for k in range(n):
        inertia = np.diag([1e-4, 7e-4, 7e-4])
        builder.link(f"link{k}", 0.1, (0.05, 0.0, 0.0), inertia, collisions=[art.Capsule(0.02, 0.06)])
        if k:
            axis = ((0, 1, 0), (0, 0, 1))[k % 2]
            builder.joint(
                f"joint{k}",
                "revolute",
                f"link{k - 1}",
                f"link{k}",
                xyz=(0.1, 0.0, 0.0),
                axis=axis,
                limits=art.Limits(-1.5, 1.5),
            )
    return builder.build("free")


def rig_of(name: str) -> art.Rig:
    if name == "chain":
        return chain(20)
    if name == "ragdoll":
        return art.load("ragdoll", root="free")
    return art.load(example_robots() / ROBOTS[name], root="free")


def points_of(rig: art.Rig, count: int = 16) -> list[art.ContactPoint]:
    """Points on links, near the ends of the rig and on its root."""
    links = [link for link in rig.links.values() if link.body >= 0 and link.mass > 0.0]
    chosen = [links[k] for k in np.linspace(0, len(links) - 1, count).astype(int)]
    rng = np.random.default_rng(3)
    return [art.ContactPoint(link.name, tuple((link.center + 0.05 * rng.normal(size=3)).tolist())) for link in chosen]


def body(shape, inertia, mass: float = 1.0) -> art.Rig:
    builder = art.RigBuilder(type(shape).__name__.lower())
    builder.link("body", mass, (0.0, 0.0, 0.0), np.diag(inertia), collisions=[shape])
    return builder.build("free")


def upright(rig, height, count=()):
    q = np.broadcast_to(rig.neutral(), (*count, rig.nq)).copy()
    q[..., 2] = height
    return q


def tilted(angle):
    """A plane that rises along x, and how things stand on it."""
    n = np.array([-math.sin(angle), 0.0, math.cos(angle)])
    return art.Plane(tuple(n)), n, np.array([0.0, -math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)])


def on_incline(rig, angle, height):
    plane, n, quat_xyzw = tilted(angle)
    q = rig.neutral()
    q[:3], q[3:] = height * n, quat_xyzw
    return plane, q
