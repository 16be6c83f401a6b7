"""A person of given height, mass and sex: 16 segments with masses, centres and inertias from published tables.

what                    from
segments                de Leva 1996, see `anthropometry`: scaled with height and mass
ankle above the sole,   parts of the height: ankle 0.039, foot 0.055, hips 0.191, chest 0.174 (D. A. Winter, Biomechanics and
and breadths            Motor Control of Human Movement, 2009, fig. 4.1, after Drillis and Contini 1966)
between the shoulders   400 of 1740 mm, 355 of 1610 mm: biacromial breadth of British adults, "lateral separation of the
                        centres of rotation of the upper limb" (S. Pheasant and C. Haslegrave, Bodyspace, dimension 18)
between the hips        0.1 of the height: the centres lie 0.36 of the distance between the anterior superior iliac spines, some
                        0.24 m, to either side (Bell, Brand and Pedersen 1989)
ranges of motion        American Academy of Orthopaedic Surgeons, Joint Motion: Method of Measuring and Recording, 1965

The people of the table were measured lying. What stands of them, one segment upon the other from ankle to vertex, adds up to a
little more than their height leaves: 2 % in men, nothing in women. Those lengths are shrunk alike to make the height exact, the
radii of gyration are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians
from typing import Any

import numpy as np

from articulated.rig.anthropometry import BOTH_SIDES, MEAN_HEIGHT, Segment, other_ends, segments
from articulated.rig.builder import RigBuilder
from articulated.rig.joint import Limits
from articulated.rig.rig import Rig
from articulated.rig.shapes import Box, Capsule, Geometry, Shape
from articulated.rig.swing_twist import SwingTwist

_ANKLE, _FOOT_BREADTH, _HIP_BREADTH, _CHEST_BREADTH, _HAND_BREADTH = 0.039, 0.055, 0.191, 0.174, 0.049
"""Parts of the height. The hand's is from Bodyspace: 85 of 1740 mm."""

_SHOULDER = {"female": 0.5 * 355.0 / 1610.0, "male": 0.5 * 400.0 / 1740.0}
_HIP = 0.05
_HEEL = 0.25
"""How far the ankle is from the heel, as a part of the foot's length."""

_DENSITY = 1000.0
"""Of the shapes [kg/m³]."""

_STRONG: dict[str, Any] = {"damping": 2.0, "armature": 0.01}
_WEAK: dict[str, Any] = {"damping": 0.2, "armature": 0.002}

_HEIGHTS, _MASSES = (0.5, 2.6), (3.0, 500.0)
"""What people can be [m, kg]."""


_Vector = tuple[float, float, float]
_UP, _FORWARD = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def person(height: float = 1.75, mass: float = 70.0, sex: str = "male", *, root: str = "free") -> Rig:
    """The rig of a person, standing with arms stretched out to the sides and palms down; x forward, y left, z up.

        rig = art.person(height=1.62, mass=58.0, sex="female")
        q0 = rig.neutral()
        q0[2] = art.standing_height(rig)  # soles on the ground

    Links: pelvis, abdomen, torso, head, and left_ and right_ upper_arm, forearm, hand, thigh, shin, foot. Joints: balls at
    waist, spine, neck, shoulders and hips, hinges at elbows and knees, two axes at wrists and ankles; a positive elbow or
    knee is bent. Each link's frame is at the joint that moves it; the root's, the pelvis's, is midway between the hips.

    Its shapes are boxes and capsules of the segments' lengths, and of the breadths and radii at which they have the density
    of water. Joints are damped a little. Both axes of a wrist or of an ankle have one range, the mean of the four published.

    Args:
        height: from the soles to the top of the head [m].
        mass: of all of it [kg].
        sex: "female" or "male": which columns of the tables.
        root: "free", "planar" (then it slides upright) or "fixed" in the air.

    Returns:
        The rig, "person". Its mass is `mass`, and the top of its head stands `height` above its soles.

    Raises:
        ValueError: the height or the mass is none that people have, or sex or root is none of these.
    """
    _check("height", height, _HEIGHTS, "metres")
    _check("mass", mass, _MASSES, "kilograms")
    body = _measure(float(height), float(mass), sex)
    builder = RigBuilder("person")
    _trunk(builder, body)
    for side, y in (("left", 1.0), ("right", -1.0)):
        _arm(builder, body, side, y)
        _leg(builder, body, side, y)
    return builder.build(root)


@dataclass(frozen=True)
class _Part:
    """A segment of this person.

    Attributes:
        segment: its row of the table.
        mass: [kg].
        length: as it stands [m].
        scale: what to multiply the table's length with for the radii of gyration.
    """

    segment: Segment
    mass: float
    length: float
    scale: float

    @property
    def center(self) -> float:
        """How far its centre of mass is from its proximal end [m]."""
        return self.segment.center * self.length

    @property
    def volume(self) -> float:
        return self.mass / _DENSITY

    def moments(self, axes: str) -> np.ndarray:
        """Principal moments of inertia about x, y and z, which are, in this order, the axes named by their first letters."""
        s = self.segment
        radii = {"s": s.sagittal, "t": s.transverse, "l": s.longitudinal}
        return self.mass * np.array([(radii[axis] * s.length * self.scale) ** 2 for axis in axes])


@dataclass(frozen=True)
class _Body:
    """Lengths [m] and parts of one person; `shoulders` is the height of the shoulders above the hips."""

    height: float
    shoulders: float
    shoulder: float
    hip: float
    parts: dict[str, _Part]


def _measure(height: float, mass: float, sex: str) -> _Body:
    rows, others = dict(segments(sex)), other_ends(sex)
    whole = sum((2 if name in BOTH_SIDES else 1) * row.mass for name, row in rows.items())
    rows["head"], rows["shank"] = others["head to cervicale"], others["shank to ankle"]
    rows["upper_trunk"], rows["hand"] = others["upper_trunk from cervicale"], others["hand to fingertip"]
    scale = height / MEAN_HEIGHT[sex]
    upright = ("shank", "thigh", "lower_trunk", "middle_trunk", "upper_trunk", "head")
    shrink = (1.0 - _ANKLE) * height / (scale * sum(rows[name].length for name in upright))
    parts = {
        name: _Part(row, mass * row.mass / whole, scale * row.length * (shrink if name in upright else 1.0), scale)
        for name, row in rows.items()
    }
    shoulders = scale * shrink * others["trunk from shoulders"].length
    return _Body(height, shoulders, _SHOULDER[sex] * height, _HIP * height, parts)


def _trunk(builder: RigBuilder, body: _Body) -> None:
    """From the hips up; the proximal ends are above, so that centres of mass are measured down from there."""
    breadths = (_HIP_BREADTH, _CHEST_BREADTH, _CHEST_BREADTH)
    names = (("pelvis", "lower_trunk"), ("abdomen", "middle_trunk"), ("torso", "upper_trunk"))
    for (link, name), breadth in zip(names, breadths, strict=True):
        part = body.parts[name]
        width = breadth * body.height
        size = (part.volume / (width * part.length), width, part.length)
        _link(builder, link, part, (0.0, 0.0, part.length - part.center), "stl", Box(size), (0.0, 0.0, 0.5 * part.length))
    head = body.parts["head"]
    _link(builder, "head", head, (0.0, 0.0, head.length - head.center), "stl", _capsule(head), (0.0, 0.0, 0.5 * head.length))
    # the trunk's ranges are those of thoracic and lumbar spine together, half of them at either joint
    bend = _ball(_UP, (40.0, 12.5, 17.5, 17.5), (-22.5, 22.5))
    nod = _ball(_UP, (45.0, 45.0, 45.0, 45.0), (-60.0, 60.0))
    chain = (("waist", "pelvis", "abdomen", bend), ("spine", "abdomen", "torso", bend), ("neck", "torso", "head", nod))
    for (joint, parent, child, limits), (_, name) in zip(chain, names, strict=True):
        builder.joint(joint, "ball", parent, child, xyz=(0.0, 0.0, body.parts[name].length), limits=limits, **_STRONG)


def _arm(builder: RigBuilder, body: _Body, side: str, y: float) -> None:
    """Out along y: its sagittal axis is still x, and its transverse one z; but a hand's palm looks down."""
    out = (0.0, y, 0.0)
    for name, axes in (("upper_arm", "slt"), ("forearm", "slt"), ("hand", "tls")):
        part = body.parts[name]
        shape = _capsule(part)
        if name == "hand":
            width = _HAND_BREADTH * body.height
            shape = Box((width, part.volume / (width * part.length), part.length))
        _link(builder, f"{side}_{name}", part, (0.0, y * part.center, 0.0), axes, shape, (0.0, 0.5 * y * part.length, 0.0), out)
    trunk = body.parts
    above = body.shoulders - trunk["lower_trunk"].length - trunk["middle_trunk"].length
    # forward and back, up and down from the horizontal: 10° more than straight down, or hanging arms would be at their limit
    swing = (130.0, 45.0) + ((90.0, 100.0) if y < 0.0 else (100.0, 90.0))
    shoulder = _ball(out, swing, (-90.0, 70.0) if y > 0.0 else (-70.0, 90.0))
    at = (0.0, y * body.shoulder, above)
    builder.joint(f"{side}_shoulder", "ball", "torso", f"{side}_upper_arm", xyz=at, limits=shoulder, **_STRONG)
    elbow: dict[str, Any] = {
        "xyz": (0.0, y * trunk["upper_arm"].length, 0.0),
        "axis": (0.0, 0.0, -y),
        "limits": _range(0.0, 150.0),
    }
    builder.joint(f"{side}_elbow", "revolute", f"{side}_upper_arm", f"{side}_forearm", **elbow, **_STRONG)
    wrist: dict[str, Any] = {"axis": (1.0, 0.0, 0.0), "axis2": (0.0, 0.0, 1.0), "limits": _range(-50.0, 50.0)}
    at = (0.0, y * trunk["forearm"].length, 0.0)
    builder.joint(f"{side}_wrist", "universal", f"{side}_forearm", f"{side}_hand", xyz=at, **wrist, **_WEAK)


def _leg(builder: RigBuilder, body: _Body, side: str, y: float) -> None:
    thigh, shank, foot = (body.parts[name] for name in ("thigh", "shank", "foot"))
    shape = _capsule(thigh)
    # flesh is outside of the hip; and the thighs do not touch
    aside = y * max(0.0, 1.05 * shape.radius - body.hip)
    _link(builder, f"{side}_thigh", thigh, (0.0, 0.0, -thigh.center), "stl", shape, (0.0, aside, -0.5 * thigh.length))
    _link(builder, f"{side}_shin", shank, (0.0, 0.0, -shank.center), "stl", _capsule(shank), (0.0, 0.0, -0.5 * shank.length))
    sole, heel = -_ANKLE * body.height, -_HEEL * foot.length
    width = _FOOT_BREADTH * body.height
    size = (foot.length, width, foot.volume / (width * foot.length))
    middle, ahead = sole + 0.5 * size[2], heel + 0.5 * foot.length
    _link(builder, f"{side}_foot", foot, (heel + foot.center, 0.0, middle), "lts", Box(size), (ahead, 0.0, middle))
    # forward, back, inwards and outwards, as seen along the left leg
    swing = (120.0, 30.0) + ((30.0, 45.0) if y > 0.0 else (45.0, 30.0))
    hip = _ball((0.0, 0.0, -1.0), swing, (-45.0, 45.0))
    at = (0.0, y * body.hip, 0.0)
    builder.joint(f"{side}_hip", "ball", "pelvis", f"{side}_thigh", xyz=at, limits=hip, **_STRONG)
    knee: dict[str, Any] = {"xyz": (0.0, 0.0, -thigh.length), "axis": (0.0, 1.0, 0.0), "limits": _range(0.0, 135.0)}
    builder.joint(f"{side}_knee", "revolute", f"{side}_thigh", f"{side}_shin", **knee, **_STRONG)
    ankle: dict[str, Any] = {"axis": (0.0, 1.0, 0.0), "axis2": (1.0, 0.0, 0.0), "limits": _range(-30.0, 30.0)}
    at = (0.0, 0.0, -shank.length)
    builder.joint(f"{side}_ankle", "universal", f"{side}_shin", f"{side}_foot", xyz=at, **ankle, **_WEAK)


def _link(
    builder: RigBuilder,
    name: str,
    part: _Part,
    center: _Vector,
    axes: str,
    geometry: Geometry,
    at: _Vector,
    along: _Vector = _UP,
) -> None:
    """A link with a shape centred `at`, whose own z axis points `along`; `axes` as in `_Part.moments`."""
    X = np.eye(4)
    x, z = np.array([1.0, 0.0, 0.0]), np.array(along)
    X[:3, :3], X[:3, 3] = np.column_stack([x, np.cross(z, x), z]), at
    shape = Shape(geometry, X)
    builder.link(name, part.mass, center, np.diag(part.moments(axes)), [shape], [shape])


def _capsule(part: _Part) -> Capsule:
    """From end to end of a segment, with its volume: π r² l − 2/3 π r³, l being the length with both half balls."""
    l = part.length

    def excess(r: float) -> float:
        return pi * r**2 * (l - 2.0 / 3.0 * r) - part.volume

    fattest = 0.49 * l
    from scipy.optimize import brentq  # it takes a while

    radius = fattest if excess(fattest) < 0.0 else float(brentq(excess, 0.0, fattest, xtol=1e-15))  # type: ignore[arg-type]
    return Capsule(radius, l - 2.0 * radius)


def _ball(axis: _Vector, swing: tuple[float, float, float, float], twist: tuple[float, float]) -> Limits:
    """Of a bone along an axis: swings forwards, back, towards axis × forwards and away from that; turns about it [degrees]."""
    ahead, back, aside, other = (radians(angle) for angle in swing)
    lower, upper = (radians(angle) for angle in twist)
    return Limits(ball=SwingTwist(axis, _FORWARD, (ahead, back, aside, other), (lower, upper)))


def _range(lower: float, upper: float) -> Limits:
    return Limits(radians(lower), radians(upper))


def _check(what: str, value: Any, between: tuple[float, float], unit: str) -> None:
    low, high = between
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not low <= value <= high:  # false for NaN
        raise ValueError(f"{what} of a person is {value!r}; expected {low:g} to {high:g} {unit}")
