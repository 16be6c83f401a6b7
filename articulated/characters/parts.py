"""Which part of the body a joint or link is, by its name: as CMU, Mixamo, Poser, Biped, Blender and others give them.

A joint's name is that of the bone that begins there. Only shoulders and hips differ from skeleton to skeleton: a LeftShoulder
is a collar bone where there is a LeftArm too, and the upper arm where there is none.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple


class Role(NamedTuple):
    """A part of the body: its name and "left", "right" or ""."""

    part: str
    side: str

    def __str__(self) -> str:
        return f"{self.side}_{self.part}".strip("_")


_WORDS = (
    (r"finger|thumb|index|ring|pinky|middle\d|mid\d|metacarp|carpal|palm", "finger"),
    (r"hand|wrist", "hand"),
    (r"forearm|lowerarm|lowarm|elbow|lorarm", "forearm"),
    (r"upperarm|uparm|shldr|bicep", "upper_arm"),
    (r"hipjoint|buttock", "pelvis"),
    (r"collar|clavicle", "collar"),
    (r"shoulder", "shoulder"),
    (r"arm", "upper_arm"),
    (r"toe|ball", "toe"),
    (r"foot|ankle|heel", "foot"),
    (r"thigh|upleg|upperleg|femur", "thigh"),
    (r"shin|calf|lowerleg|lowleg|knee|tibia", "shin"),
    (r"leg", "leg"),
    (r"neck", "neck"),
    (r"head|jaw|eye|skull", "head"),
    (r"chest|torso|thorax|spine\d*[23]|upperback|spineupper|spine0?[3-9]", "torso"),
    (r"spine|back|abdomen|waist|belly|lumbar", "abdomen"),
    (r"hips?$|pelvis|root|body", "pelvis"),
)

_SIDES = (
    (r"[Ll]eft|LEFT|^[lL](?=[A-Z_. ])|(?<=[_. ])[lL](?=[_. ]|$)|(?<=[a-z])L$", "left"),
    (r"[Rr]ight|RIGHT|^[rR](?=[A-Z_. ])|(?<=[_. ])[rR](?=[_. ]|$)|(?<=[a-z])R$", "right"),
)


def roles(names: Iterable[str]) -> dict[str, Role]:
    """The parts that these names of one figure mean; names that mean none are left out."""
    found = {name: role for name in names if (role := _role(name)) is not None}
    arms = {role.side for role in found.values() if role.part == "upper_arm"}
    legs = {role.side for role in found.values() if role.part == "thigh"}
    result = {}
    for name, (part, side) in found.items():
        if part == "shoulder":
            part = "collar" if side in arms else "upper_arm"
        elif part == "leg":  # LeftUpLeg, LeftLeg; but also Leg, Shin
            part = "shin" if side in legs else "thigh"
        elif part == "pelvis" and side and re.search(r"hip$", name, re.IGNORECASE):
            part = "thigh"
        result[name] = Role(part, side)
    return result


def _role(name: str) -> Role | None:
    bare = re.sub(r"^.*:|^mixamorig\d*_?|^bip\d*[_ ]*|^def[-_]", "", name, flags=re.IGNORECASE).replace("-", "_")
    side = ""
    for pattern, which in _SIDES:
        if re.search(pattern, bare):
            side, bare = which, re.sub(pattern, "", bare, count=1)
            break
    plain = re.sub(r"[^a-z0-9]", "", bare.lower())
    if not plain and name:
        return None
    for pattern, part in _WORDS:
        if re.search(pattern, plain):
            return Role(part, side)
    return None
