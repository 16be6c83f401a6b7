"""Things that touch each other, in states where they do."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import articulated as art


def loose(shape, mass, name="loose"):
    """A free body of even density."""
    if isinstance(shape, art.Sphere):
        inertia = 0.4 * mass * shape.radius**2 * np.ones(3)
    else:
        x, y, z = np.square(shape.size)
        inertia = mass / 12.0 * np.array([y + z, x + z, x + y])
    builder = art.RigBuilder(name)
    builder.link("body", mass, (0.0, 0.0, 0.0), np.diag(inertia), collisions=[shape])
    return builder.build("free")


def boxes(count, side=0.2, mass=1.0):
    return art.compose(**{f"box{k}": loose(art.Box((side, side, side)), mass) for k in range(count)})


def ragdoll():
    return art.load("ragdoll", root="free")


def free(rig):
    """The joints by which parts float."""
    return [joint for joint in rig.joints.values() if joint.kind == "floating"]


def put(rig, q, k, position, rotation=None):
    """Stand the k-th part of a forest somewhere, in configurations q."""
    at = free(rig)[k].q_slice.start
    q[..., at : at + 3] = position
    if rotation is not None:
        q[..., at + 3 : at + 7] = rotation.as_quat()


def crumpled(rng, count, reach=0.9):
    """Ragdolls with limbs anywhere, some of them in each other."""
    rig = ragdoll()
    q = rig.random(rng, count)
    neutral = rig.neutral()
    for joint in rig.joints.values():
        if joint.nq == 1:
            q[:, joint.q_slice] = np.clip(
                neutral[joint.q_slice] + reach * rng.normal(size=(count, 1)), joint.limits.lower, joint.limits.upper
            )
        elif joint.kind == "ball":
            turn = reach * rng.normal(size=(count, 3))
            q[:, joint.q_slice] = Rotation.from_rotvec(turn).as_quat()
    return rig, q


def within_limits(rig, q):
    """The same configurations, with what is beyond its stops at them."""
    q = q.copy()
    for joint in rig.joints.values():
        part, upper = joint.q_slice, joint.limits.upper
        if joint.kind == "ball":
            turn = Rotation.from_quat(q[:, part]).as_rotvec()
            angle = np.linalg.norm(turn, axis=1, keepdims=True)
            q[:, part] = Rotation.from_rotvec(turn * np.minimum(1.0, upper / np.maximum(angle, 1e-9))).as_quat()
        elif joint.kind != "floating":
            q[:, part] = np.clip(q[:, part], joint.limits.lower, upper)
    return q
