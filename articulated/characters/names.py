"""Which segment of a body a bone is, by its name: as the usual tools write them."""

from __future__ import annotations

from collections.abc import Sequence

_MEANINGS = (
    ("foot", ("toe", "foot", "ankle", "heel")),
    ("forearm", ("forearm", "lowerarm", "elbow", "radius")),
    ("hand", ("hand", "wrist", "finger", "thumb", "index", "pinky", "palm", "midfing", "ringfing", "pinkfing")),
    ("upper_trunk", ("collar", "clavicle", "scapula", "chest", "thorax", "upperback", "spine1", "spine2", "spine3")),
    ("thigh", ("upleg", "thigh", "upperleg", "femur")),
    ("lower_trunk", ("hipjoint", "buttock")),
    ("shank", ("leg", "shin", "calf", "knee", "tibia")),
    ("upper_arm", ("arm", "shldr", "humerus")),
    ("head", ("neck", "head", "jaw", "eye")),
    ("middle_trunk", ("spine", "lowerback", "abdomen", "torso", "waist", "back")),
)
"""Segments, and parts of names that mean them; what comes first counts."""

_SIDES = ("left", "right")


def core(name: str) -> str:
    """A name without what tools put before it, in small letters: "mixamorig:LeftUpLeg" is "leftupleg"."""
    return "".join(c for c in name.rsplit(":", 1)[-1].lower() if c.isalnum())


def side(name: str) -> str:
    """Which side a name is of: "left", "right", or "" for the middle."""
    bare = name.rsplit(":", 1)[-1]
    small = bare.lower()
    for word in _SIDES:
        letter = word[0]
        marked = small.endswith(tuple(f"{mark}{letter}" for mark in "._- ")) or small.startswith(
            tuple(f"{letter}{m}" for m in "._- ")
        )
        camel = len(bare) > 1 and bare[0] in (letter, letter.upper()) and bare[1].isupper()
        if word in small or marked or camel:
            return word
    return ""


def segments_of(names: Sequence[str]) -> list[str]:
    """Of each bone the segment of the body, as in `rig.anthropometry`, or "" if its name says nothing."""
    cores = [core(name) for name in names]
    collars = any("collar" in c or "clavicle" in c for c in cores)
    thighs = any("upleg" in c or "thigh" in c or "upperleg" in c for c in cores)
    return [_segment(c, bool(side(name)), collars, thighs) for c, name in zip(cores, names, strict=True)]


def _segment(core: str, sided: bool, collars: bool, thighs: bool) -> str:
    if "shoulder" in core:  # beside a collar it is where the arm hangs, else the collar itself
        return "upper_arm" if collars else "upper_trunk"
    for segment, parts in _MEANINGS:
        if any(part in core for part in parts):
            return segment
    if "hip" in core or "pelvis" in core or core == "root":
        return "thigh" if sided and not thighs else "lower_trunk"
    return ""
