"""From a skeleton to a rig with flesh on it: a capsule a bone, masses from the table of segments."""

from __future__ import annotations

import math

import numpy as np

from articulated.characters.limits import fit_swing_twist
from articulated.characters.names import segments_of
from articulated.rig import Capsule, Limits, Rig, RigBuilder, Shape, Sphere, SwingTwist, mass_properties
from articulated.rig.anthropometry import BOTH_SIDES, segments
from articulated.rig.errors import Place
from articulated.rig.frames import rotation_with_z_along
from articulated.rig.skeleton import Skeleton

_STILL = 1e-6
"""A joint that turns less never turns [rad]."""
_SHORT = 5e-3
"""A bone shorter than this is a ball [m]."""
_BALL = 0.02
_THIN, _THICK = 0.012, 0.14
"""Radii of capsules [m]."""
_UNKNOWN = 0.12
"""Radius over length of a bone that nothing is known of."""
_ENOUGH = 0.6
"""If the names account for less of a body than this, all bones are equally dense."""


def build_rig(
    name: str, skeleton: Skeleton, quats: np.ndarray, mass: float, sex: str, limits: str | None, root: str, place: Place
) -> Rig:
    """The rig of a skeleton whose joints do this, shape (joints, frames, 4); see `from_bvh`."""
    if limits not in ("clip", None):
        raise ValueError(f"limits is {limits!r}; expected 'clip' or None")
    if not isinstance(mass, (int, float, np.number)) or not 0.0 < mass < math.inf:
        raise ValueError(f"mass is {mass!r}; expected a positive number of kilograms")
    table = segments(sex)
    builder = RigBuilder(name, place.source)
    tips, kinds = _tips(skeleton), segments_of([bone.name for bone in skeleton.bones])
    shapes = _shapes(tips, kinds, table, mass)
    short = [bone.name for bone, tip in zip(skeleton.bones, tips, strict=True) if not len(_long(tip))]
    if short:
        place.warn(f"bones of no length: {', '.join(short)}", f"each has a ball of {_BALL:g} m radius")
    for bone, own, weight in zip(skeleton.bones, shapes, _weights(shapes, kinds, table, mass), strict=True):
        solid = mass_properties(own, mass=weight)
        builder.link(bone.name, solid.mass, solid.center, solid.inertia, own, own)
    still = []
    for k, bone in enumerate(skeleton.bones):
        if bone.parent < 0:
            continue
        parent, at = skeleton.bones[bone.parent].name, skeleton.scale * skeleton.turn @ bone.offset
        if 2.0 * np.arcsin(np.clip(np.linalg.norm(quats[k, :, :3], axis=-1), 0.0, 1.0)).max() < _STILL:
            builder.joint(bone.name, "fixed", parent, bone.name, xyz=at)
            still.append(bone.name)
            continue
        light = kinds[k] in ("hand", "foot", "head", "")
        own_limits = Limits(ball=_limits(tips[k], quats[k])) if limits else Limits()
        passive = {"damping": 0.2, "armature": 0.002} if light else {"damping": 1.0, "armature": 0.01}
        builder.joint(bone.name, "ball", parent, bone.name, xyz=at, limits=own_limits, **passive)  # type: ignore[arg-type]
    if still:
        place.warn(f"joints that never turn: {', '.join(still)}", "they are fixed")
    for a, b in _touching(skeleton, shapes):
        builder.disable_collisions(a, b)
    return builder.build(root)


def _tips(skeleton: Skeleton) -> list[np.ndarray]:
    """Where the bones of each joint end, in its link's frame, shape (n, 3) [m]."""
    ends: list[list[tuple[float, ...]]] = [list(bone.ends) for bone in skeleton.bones]
    for bone in skeleton.bones:
        if bone.parent >= 0:
            ends[bone.parent].append(bone.offset)
    return [skeleton.scale * np.reshape(end, (-1, 3)) @ skeleton.turn.T for end in ends]


def _long(tips: np.ndarray) -> np.ndarray:
    return tips[np.linalg.norm(tips, axis=-1) > _SHORT]


def _shapes(tips: list[np.ndarray], kinds: list[str], table, mass: float) -> list[list[Shape]]:
    """Capsules of each link; as thick as its segment's mass makes it at the density of water."""
    lengths = dict.fromkeys(table, 0.0)
    for own, kind in zip(tips, kinds, strict=True):
        if kind:
            lengths[kind] += float(np.linalg.norm(_long(own), axis=-1).sum())
    radii = {}
    for kind, length in lengths.items():
        count = 2.0 if kind in BOTH_SIDES else 1.0
        volume = count * table[kind].mass * mass / 1000.0
        radii[kind] = float(np.clip(math.sqrt(volume / (math.pi * length)), _THIN, _THICK)) if length > _SHORT else _BALL
    result = []
    for own, kind in zip(tips, kinds, strict=True):
        shapes = []
        for tip in _long(own):
            length = float(np.linalg.norm(tip))
            radius = min(radii[kind], 0.5 * length) if kind else float(np.clip(_UNKNOWN * length, _THIN, _THICK))
            X = np.eye(4)
            X[:3, :3], X[:3, 3] = rotation_with_z_along(tip), 0.5 * tip
            shapes.append(Shape(Capsule(radius, max(length - 2.0 * radius, 0.0)), X))
        result.append(shapes or [Shape(Sphere(_BALL))])
    return result


def _weights(shapes: list[list[Shape]], kinds: list[str], table, mass: float) -> list[float]:
    volumes = np.array([mass_properties(own, 1.0).mass for own in shapes])
    known = {kind for kind in kinds if kind}
    counts = {kind: 2.0 if kind in BOTH_SIDES else 1.0 for kind in known}
    if sum(counts[kind] * table[kind].mass for kind in known) < _ENOUGH:
        return (mass * volumes / volumes.sum()).tolist()
    weights = 1000.0 * volumes
    for kind in known:
        own = np.array([k == kind for k in kinds])
        weights[own] = counts[kind] * table[kind].mass * mass * volumes[own] / volumes[own].sum()
    return (mass * weights / weights.sum()).tolist()


def _limits(tips: np.ndarray, quats: np.ndarray) -> SwingTwist:
    """About the direction of the longest bone."""
    some = _long(tips)
    axis = some[np.argmax(np.linalg.norm(some, axis=-1))] if len(some) else np.array([0.0, 0.0, 1.0])
    axis = axis / np.linalg.norm(axis)
    toward = np.eye(3)[int(np.argmin(np.abs(axis)))]
    return fit_swing_twist(quats, axis.tolist(), toward.tolist())


def _touching(skeleton: Skeleton, shapes: list[list[Shape]]) -> list[tuple[str, str]]:
    """Links that touch at rest, or hang by one another."""
    places: list[np.ndarray] = []
    for bone in skeleton.bones:
        at = skeleton.scale * skeleton.turn @ bone.offset
        places.append(at + places[bone.parent] if bone.parent >= 0 else np.zeros(3))
    clouds = [_moved(_cloud(own), place) for own, place in zip(shapes, places, strict=True)]
    pairs = []
    for j, bone in enumerate(skeleton.bones):
        for i in range(j):
            apart = np.linalg.norm(clouds[i][:, None, :3] - clouds[j][None, :, :3], axis=-1)
            reach = clouds[i][:, None, 3] + clouds[j][None, :, 3]
            if bone.parent == i or (apart < reach + 0.01).any():
                pairs.append((skeleton.bones[i].name, bone.name))
    return pairs


def _cloud(shapes: list[Shape]) -> np.ndarray:
    """Points along the middle of capsules, with radii, shape (n, 4)."""
    rows = []
    for shape in shapes:
        r, half = shape.geometry.radius, 0.5 * getattr(shape.geometry, "length", 0.0)  # type: ignore[union-attr]
        for s in np.linspace(-half, half, 9):
            rows.append([*(shape.pose[:3, 3] + s * shape.pose[:3, 2]), r])
    return np.array(rows)


def _moved(cloud: np.ndarray, place: np.ndarray) -> np.ndarray:
    return cloud + np.append(place, 0.0)
