"""Motions as BVH files, written by pybvh."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from articulated.dynamics.functions import link_poses
from articulated.extras import need
from articulated.rig import Rig
from articulated.rig.skeleton import Bone, Skeleton
from articulated.trajectory.motion import Motion

_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def write_bvh(motion: Motion, path: str | os.PathLike[str]) -> None:
    """The motion on the skeleton that it or its rig was read with; of any other rig a joint for each link, y up, centimetres.

    Only turns are written, and where the root is: joints that slide are refused.

    Raises:
        ValueError: a joint slides, or there is no link that moves.
        ImportError: pybvh is not installed; the error names the extra.
    """
    from articulated.trajectory.files import written

    skeleton = motion.skeleton or motion.rig.skeleton or _skeleton_of(motion.rig)
    bvh = _bvh(skeleton, motion)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "motion.bvh"
        bvh.write(whole)
        with written(path, "w") as file:
            file.write(whole.read_text())


def _bvh(skeleton: Skeleton, motion: Motion) -> Any:
    pybvh = need("pybvh", "mocap")
    from pybvh import bvhnode  # type: ignore[import-not-found]

    nodes: list[Any] = []
    made: list[Any] = []
    children: dict[int, list[int]] = {}
    for k, bone in enumerate(skeleton.bones):
        children.setdefault(bone.parent, []).append(k)

    def add(k: int) -> None:
        bone = skeleton.bones[k]
        if bone.parent < 0:
            node = bvhnode.BvhRoot(bone.name, list(bone.offset), list(skeleton.channels), list(bone.order), [], None)
        else:
            node = bvhnode.BvhJoint(bone.name, list(bone.offset), list(bone.order), [], made[bone.parent])
            made[bone.parent].children = [*made[bone.parent].children, node]
        nodes.append(node)
        made[k] = node
        for end in bone.ends:
            site = bvhnode.BvhEndSite(f"EndSite{bone.name}", list(end), node)
            node.children = [*node.children, site]
            nodes.append(site)
        for child in children.get(k, []):
            add(child)

    made.extend([None] * len(skeleton.bones))
    add(0)
    order = [node.name for node in nodes if not node.is_end_site()]
    position, angles = _channels(skeleton, motion)
    index = {bone.name: k for k, bone in enumerate(skeleton.bones)}
    return pybvh.Bvh(
        nodes=nodes,
        root_pos=position,
        joint_angles=angles[:, [index[name] for name in order]],
        frame_time=1.0 / motion.fps,
        world_up="+y",
    )


def _channels(skeleton: Skeleton, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """The root's position, shape (T, 3), and the angles of all joints, shape (T, n, 3) [rad]."""
    rig = motion.rig
    X, rest = link_poses(rig, motion.q), link_poses(rig, rig.neutral())
    C = Rotation.from_matrix(skeleton.turn)
    turns = []
    for bone in skeleton.bones:
        k = rig.links[bone.name].index
        turns.append(Rotation.from_matrix(X[:, k, :3, :3]) * Rotation.from_matrix(rest[k, :3, :3]).inv())
    angles = np.empty((len(motion.q), len(skeleton.bones), 3))
    for k, bone in enumerate(skeleton.bones):
        own = turns[k] if bone.parent < 0 else turns[bone.parent].inv() * turns[k]
        angles[:, k] = (C.inv() * own * C).as_euler(bone.order)
    angles = np.unwrap(angles, axis=0)
    root = X[:, rig.links[skeleton.bones[0].name].index, :3, 3]
    return root @ skeleton.turn / skeleton.scale, angles


def _skeleton_of(rig: Rig) -> Skeleton:
    """A skeleton for any rig: links that a joint moves, where the rig is neutral."""
    if sliding := [
        name for name, joint in rig.joints.items() if joint.kind in ("prismatic", "planar") and not rig.is_root(joint)
    ]:
        raise ValueError(f"joints {', '.join(sliding)} slide, which BVH does not know; export .glb or .csv")
    moving = [body.name for body in rig.bodies]
    if not moving:
        raise ValueError(f"rig {rig.name!r} has no link that moves; there is nothing to write")
    X = link_poses(rig, rig.neutral())
    at = {name: X[rig.links[name].index, :3, 3] @ _Y_UP / 0.01 for name in moving}
    first = [name for name, body in zip(moving, rig.bodies, strict=True) if body.parent < 0]
    if len(first) > 1:
        raise ValueError(f"rig {rig.name!r} has {len(first)} roots, {', '.join(first)}; BVH has one: export .glb or .csv")
    bones: list[Bone] = []
    for name, body in zip(moving, rig.bodies, strict=True):
        parent = body.parent
        offset = at[name] - at[moving[parent]] if parent >= 0 else np.zeros(3)
        leaf = all(other.parent != len(bones) for other in rig.bodies)
        x, y, z = offset.tolist()
        bones.append(Bone(name, parent, (x, y, z), "ZYX", ((0.0, 0.0, 0.0),) if leaf else ()))
    return Skeleton(tuple(bones), 0.01, _Y_UP)
