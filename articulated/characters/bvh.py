"""Motion capture in: a BVH file as a rig and a motion. Read by pybvh.

A BVH joint turns in its parent's axes, and at rest all axes are the file's. So are those of our links: file axes, turned once
so that z is up. What the file calls a joint is our link of that name, and the joint that moves it.
"""

from __future__ import annotations

import math
import os
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from articulated.characters.bodies import build_rig
from articulated.characters.document import Document, read_document, steady
from articulated.characters.gaps import whole
from articulated.characters.parts import roles
from articulated.extras import need
from articulated.rig import Rig
from articulated.rig.errors import Place
from articulated.rig.skeleton import Bone, Skeleton
from articulated.trajectory import Motion

UNITS = {
    "metres": 1.0,
    "the unit of CMU's database": 0.0254 / 0.45,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 0.001,
}
"""Units that files come in, in metres."""

_TALL = 1.7
_HEIGHTS = (1.2, 2.3)
"""How tall a figure in motion capture may be [m]."""

_UPRIGHT = 0.8
"""The cosine of how far a figure may lean for its axis to be the one that is up."""

_TURNS = {
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}
"""From a file's axes to ours, by the axis that is up: what faces along z, with y up, faces along x."""


def from_bvh(
    path: str | os.PathLike[str],
    *,
    scale: float | str = "auto",
    up: str = "auto",
    mass: float = 70.0,
    sex: str = "male",
    limits: str | None = "clip",
    root: str = "free",
    repair: bool = False,
) -> tuple[Rig, Motion]:
    """A motion-capture file as a rig, and as a motion of it.

        rig, walk = art.from_bvh("walk.bvh")
        run = art.simulate(rig, q0=walk.q[0], v0=walk.v[0], ground=True)

    Each joint becomes a ball joint, each bone a capsule. Bones whose names are known (as of CMU, Mixamo, Poser, Biped, Blender
    and the like) have the masses and, from these, the radii of de Leva's table; others are as dense as these. Joints that never
    turn are fixed. Neighbours that touch at rest do not collide. Some clips begin with a frame of the figure at rest, which
    is no part of what it does: `art.audit` tells of the jump, and `motion.part` leaves it out.

    Args:
        path: of the file.
        scale: metres in its unit of length; "auto" takes the usual unit that makes the figure as tall as people are, and warns.
        up: "y", "z" or "x"; "auto" goes by the figure.
        mass: of all of it [kg].
        sex: "male" or "female": whose segments.
        limits: "clip" for limits as wide as what joints do, and 10 degrees more; None for none.
        root: "free" or "fixed"; see `load`.
        repair: fill frames that hold NaN from those before and after, instead of refusing them; a `RigWarning` names them.

    Returns:
        The rig and the motion. The root's position is the file's, scaled; z is up, and z where y was up is x.

    Raises:
        ValueError: the file is no BVH, or is damaged: which, where, and what to do; or an argument is impossible.
        FileNotFoundError: there is none.
        ImportError: pybvh is not installed; the error names the extra.
    """
    place = Place(os.fspath(path))
    document = read_document(path)
    bvh = _read(steady(whole(document, repair)))
    angles, position = bvh.joint_angles, bvh.root_pos
    turn = _turn(bvh, up, place)
    bones = _bones(bvh)
    metres = _metres(bvh, bones, turn, scale, place)
    skeleton = Skeleton(bones, metres, turn, "".join(bvh.root.pos_channels))
    by_joint = zip(np.moveaxis(angles, 1, 0), bones, strict=True)
    quats = np.stack([_quaternions(own, bone.order, turn) for own, bone in by_joint])
    rig = replace(build_rig(Path(path).stem, skeleton, quats, mass, sex, limits, root, place), skeleton=skeleton)
    q = np.tile(rig.neutral(), (len(angles), 1))
    for bone, quat in zip(bones, quats, strict=True):
        joint = rig.joints.get(bone.name if bone.parent >= 0 else next(iter(rig.joints), ""))
        if joint is not None and (bone.parent >= 0 or rig.is_root(joint)):
            q[:, joint.q_slice.stop - 4 : joint.q_slice.stop] = quat
            if bone.parent < 0:
                q[:, joint.q_slice.start : joint.q_slice.start + 3] = metres * position @ turn.T
    return rig, Motion(rig, q, 1.0 / bvh.frame_time, Path(path).stem, skeleton)


def _read(document: Document) -> Any:
    """By pybvh, in the form that it knows best."""
    pybvh = need("pybvh", "mocap")
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what it guesses of axes is asked for below
        clip = Path(folder) / "clip.bvh"
        clip.write_text(document.normal_text(), encoding="utf-8")
        return pybvh.read_bvh_file(clip)


def _turn(bvh: Any, up: str, place: Place) -> np.ndarray:
    if up == "auto":
        found = _from_feet_to_head(bvh)
        if found is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = str(bvh.world_up)
        if found[0] == "-":
            raise place.error(f"seems to have {found} up", "say which axis is up: up='y', 'z' or 'x'")
        up = found[-1].lower()
    if up not in _TURNS:
        raise ValueError(f"up is {up!r}; expected 'auto', 'x', 'y' or 'z'")
    return _TURNS[up]


def _from_feet_to_head(bvh: Any) -> str | None:
    """The signed axis along which a figure is upright in the clip, or else at rest; None if names or poses do not tell."""
    known, index = roles(bvh.joint_names), {node.name: k for k, node in enumerate(bvh.nodes)}
    top = [index[name] for part in ("head", "neck", "torso") for name, role in known.items() if role.part == part]
    feet = [index[name] for name, role in known.items() if role.part == "foot"]
    if not top or not feet:
        return None
    for places in (np.asarray(bvh.node_positions()), np.asarray(bvh.rest_pose_positions())[None]):
        along = (places[:, top[0]] - places[:, feet].mean(axis=1)).mean(axis=0)
        k = int(np.argmax(np.abs(along)))
        if np.abs(along[k]) > _UPRIGHT * np.linalg.norm(along) > 0.0:
            return ("-" if along[k] < 0.0 else "+") + "xyz"[k]
    return None


def _bones(bvh: Any) -> tuple[Bone, ...]:
    nodes = [node for node in bvh.nodes if not node.is_end_site()]
    index = {id(node): k for k, node in enumerate(nodes)}
    ends: dict[int, list[tuple[float, ...]]] = {}
    for node in bvh.nodes:
        if node.is_end_site():
            ends.setdefault(index[id(node.parent)], []).append(tuple(node.offset.tolist()))
    return tuple(
        Bone(
            node.name,
            index[id(node.parent)] if node.parent is not None else -1,
            tuple(node.offset.tolist()),
            "".join(node.rot_channels),
            tuple(ends.get(k, ())),  # type: ignore[arg-type]
        )
        for k, node in enumerate(nodes)
    )


def rest_positions(bones: tuple[Bone, ...]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Of joints where nothing is turned, shape (n, 3), and of the end sites of each, in the file's axes and unit."""
    places: list[np.ndarray] = []
    for bone in bones:
        places.append(np.array(bone.offset) + places[bone.parent] if bone.parent >= 0 else np.zeros(3))
    return np.array(places), [place + np.reshape(bone.ends, (-1, 3)) for bone, place in zip(bones, places, strict=True)]


def _metres(bvh: Any, bones: tuple[Bone, ...], turn: np.ndarray, scale: float | str, place: Place) -> float:
    if not isinstance(scale, str):
        if not isinstance(scale, (int, float, np.number)) or not 0.0 < scale < math.inf:
            raise ValueError(f"scale is {scale!r}; expected metres in a unit of the file, or 'auto'")
        return float(scale)
    if scale != "auto":
        raise ValueError(f"scale is {scale!r}; expected metres in a unit of the file, or 'auto'")
    joints, ends = rest_positions(bones)
    points = np.concatenate([joints, *ends]) @ turn.T
    in_clip = np.asarray(bvh.node_positions())[:: max(1, bvh.frame_count // 50)] @ turn.T
    tall = max(float(np.ptp(points[:, 2])), float(np.nanmedian(np.ptp(in_clip[..., 2], axis=-1))))
    unit = min(UNITS, key=lambda name: abs(math.log(max(UNITS[name] * tall, 1e-9) / _TALL)))
    height = UNITS[unit] * tall
    if not _HEIGHTS[0] <= height <= _HEIGHTS[1]:
        raise place.error(
            f"has a figure {tall:g} units tall, in no usual unit that of a person", "give scale, metres in a unit"
        )
    place.warn(
        f"has a figure {tall:.4g} units tall, taken as {unit}: {height:.2f} m", "give scale, metres in a unit, if it is not"
    )
    return UNITS[unit]


def _quaternions(angles: np.ndarray, order: str, turn: np.ndarray) -> np.ndarray:
    """Of turns about the file's own axes, one after the other, in ours: C R Cᵀ; shapes (T, 3) and (T, 4)."""
    R = Rotation.from_euler(order, angles)
    C = Rotation.from_matrix(turn)
    return (C * R * C.inv()).as_quat()
