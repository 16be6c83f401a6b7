"""What a source says of links and joints, one by one, before they are put together; and what is checked of each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from articulated.rig.errors import Place
from articulated.rig.joint import ALIASES, KINDS, Limits, Mimic
from articulated.rig.shapes import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Geometry,
    Hollow,
    Mesh,
    Shape,
    Solid,
    Sphere,
    dimensions,
    thickest_wall,
)
from articulated.rig.swing_twist import SwingTwist

FARTHEST = 50.0
"""A joint or a shape farther or larger than this [m] was probably given in millimetres."""

LARGEST_LIMIT = 8.0 * math.pi
"""An angle limit beyond this [rad] was probably given in degrees."""

LARGEST = 1e30
"""No number of a rig is larger, and no mass smaller than its inverse: products of a few of them must stay finite."""

INERTIA_TOLERANCE = 1e-3
"""How far, relative to its largest moment, an inertia may violate the triangle inequality: digits cut from a file."""


@dataclass(frozen=True, eq=False)
class LinkDescription:
    """A link as its source gives it. The inertia is about the centre of mass, in link axes."""

    name: str
    mass: float
    center: np.ndarray
    inertia: np.ndarray
    collisions: tuple[Shape, ...]
    visuals: tuple[Shape, ...]
    place: Place


@dataclass(frozen=True, eq=False)
class JointDescription:
    """A joint as its source gives it; `pose` is its frame in the parent link's."""

    name: str
    kind: str
    parent: str
    child: str
    pose: np.ndarray
    axis: np.ndarray
    axis2: np.ndarray | None
    limits: Limits
    damping: float
    friction: float
    armature: float
    mimic: Mimic | None
    place: Place


def check_link(link: LinkDescription) -> None:
    """Refuse what no link can be; warn of what it hardly is."""
    place = link.place
    if not link.name:
        raise place.error("has no name", "name it")
    if not (link.mass == 0.0 or 1.0 / LARGEST <= link.mass <= LARGEST):  # false for NaN
        raise place.error(f"mass is {link.mass:g}", "give a positive number of kilograms, or no inertial for a mere frame")
    _check_finite(place, "centre of mass", link.center)
    _check_finite(place, "inertia", link.inertia)
    if np.abs(link.inertia - link.inertia.T).max() > 1e-9 * np.abs(link.inertia).max():
        raise place.error("inertia is not a symmetric matrix", "give ixx, ixy, ixz, iyy, iyz, izz or a symmetric 3x3")
    if link.mass == 0.0 and np.any(link.inertia):
        place.warn("has a rotational inertia but no mass", "give it a mass")
    if link.mass > 0.0:
        gyration = math.sqrt(float(np.abs(link.inertia).max()) / link.mass)
        if gyration > FARTHEST or np.linalg.norm(link.center) > FARTHEST:
            place.warn(f"{link.mass:g} kg is spread over more than {FARTHEST:g} m", "units are metres, kilograms and kg m²")
    for shape in (*link.collisions, *link.visuals):
        check_shape(place, shape)


def check_joint(joint: JointDescription) -> None:
    """Refuse what no joint can be; warn of what it hardly is."""
    place = joint.place
    if not joint.name:
        raise place.error("has no name", "name it")
    if joint.kind not in KINDS and joint.kind != "fixed":
        known = ", ".join(["fixed", *KINDS, *ALIASES])
        raise place.error(f"unknown joint type {joint.kind!r}", f"use one of {known}")
    if not joint.parent or not joint.child:
        raise place.error(f"names no {'child' if joint.parent else 'parent'} link", "a joint needs a parent and a child")
    if joint.parent == joint.child:
        raise place.error(f"joins link {joint.child!r} to itself", "name two links")
    _check_finite(place, "origin", joint.pose)
    if np.linalg.norm(joint.pose[:3, 3]) > FARTHEST:
        place.warn(f"lies {np.linalg.norm(joint.pose[:3, 3]):g} m from its parent", "units are metres; were these millimetres?")
    _check_axes(joint)
    _check_numbers(joint)
    if joint.mimic and joint.kind != "fixed" and KINDS[joint.kind].nv != 1:
        raise place.error(f"a {joint.kind} joint cannot follow another", "only joints of one coordinate can")
    if joint.mimic and not (math.isfinite(joint.mimic.multiplier) and joint.mimic.multiplier != 0.0):
        raise place.error(f"mimic multiplier is {joint.mimic.multiplier:g}", "give a finite one, or make the joint fixed")
    if joint.mimic and not math.isfinite(joint.mimic.offset):
        raise place.error(f"mimic offset is {joint.mimic.offset:g}", "give a finite number")


def check_shape(place: Place, shape: Shape) -> None:
    """Refuse what no shape of a link can be; warn of what it hardly is."""
    geometry = shape.geometry
    if isinstance(geometry, Solid):
        raise place.error(
            f"a {type(geometry).__name__} can be weighed, but it is no shape of a link",
            f"give {stand_in(geometry)} as its shape, and mass, center and inertia from mass_properties",
        )
    if not isinstance(geometry, Geometry):
        raise place.error(f"a geometry is {geometry!r}", "give a Sphere, Box, Cylinder, Capsule or Mesh")
    check_lengths(place, shape)


def check_lengths(place: Place, shape: Shape) -> None:
    """Refuse what neither a shape nor a solid can measure; warn of what it hardly does."""
    geometry, wall = shape.geometry, None
    if isinstance(geometry, Hollow):
        geometry, wall = geometry.geometry, geometry.wall
        if not isinstance(geometry, Sphere | Box | Cylinder | Capsule | Cone | Ellipsoid):
            raise place.error(f"Hollow of {geometry!r}", "give a Sphere, Box, Cylinder, Capsule, Cone or Ellipsoid")
    sizes = dimensions(geometry)
    kind = type(geometry).__name__.lower()
    _check_finite(place, f"pose of its {kind}", shape.pose)
    wanted = {Sphere: 1, Box: 3, Mesh: 3, Ellipsoid: 3}.get(type(geometry), 2)
    if np.shape(sizes) != (wanted,) or not all(isinstance(size, Real) for size in sizes):
        raise place.error(f"{kind} has size {sizes}", f"give {wanted} number{'s' if wanted > 1 else ''}")
    if not all(abs(size) <= LARGEST for size in sizes):  # false for NaN
        raise place.error(f"{kind} has size {sizes}", "give finite numbers")
    if isinstance(geometry, Mesh):
        if 0.0 in sizes:
            raise place.error(f"mesh scale is {sizes}", "give numbers other than zero")
        return
    if min(sizes) < 0.0 or (min(sizes) == 0.0 and kind != "capsule"):
        raise place.error(f"{kind} has size {sizes}", "give positive lengths in metres")
    if max(sizes) > FARTHEST:
        place.warn(f"{kind} is {max(sizes):g} m large", "units are metres; were these millimetres?")
    if wall is not None and not (isinstance(wall, Real) and 0.0 < wall < thickest_wall(geometry)):  # false for NaN
        limit = f"less than {thickest_wall(geometry):g} m, which would fill it"
        raise place.error(f"{geometry} has a wall of {wall!r}", f"give more than zero and {limit}, or None for a thin shell")


def stand_in(solid: Solid) -> str:
    """What a link can have as its shape instead of a solid that can only be weighed."""
    if isinstance(solid, Cone):
        return "a Cylinder, or the path of a mesh"
    if isinstance(solid, Ellipsoid):
        return "a Sphere or a Capsule, or the path of a mesh"
    outer = solid.geometry
    return stand_in(outer) if isinstance(outer, Cone | Ellipsoid) else f"its {type(outer).__name__}"


def second_moment(inertia: np.ndarray) -> np.ndarray:
    """∫ x xᵀ dm about the centre of mass; it is positive semidefinite just where the triangle inequality holds.

    Wensing, Kim, Slotine 2018, "Linear matrix inequalities for physically consistent inertial parameter identification".
    """
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def violation(inertia: np.ndarray, mass: float) -> float:
    """By how much an inertia violates the triangle inequality, relative to its largest moment (0: not at all).

    Moments far below those of a mass spread over a tenth of a millimetre are rounding noise about zero.
    """
    largest = max(np.abs(np.linalg.eigvalsh(inertia)).max(), 1e-8 * mass)
    if largest == 0.0:
        return 0.0
    return max(0.0, -2.0 * np.linalg.eigvalsh(second_moment(inertia))[0] / largest)


def repaired(inertia: np.ndarray) -> np.ndarray:
    """The nearest inertia that some distribution of mass could have: negative second moments become zero."""
    moments, axes = np.linalg.eigh(second_moment(inertia))
    possible = axes @ np.diag(np.maximum(moments, 0.0)) @ axes.T
    return np.trace(possible) * np.eye(3) - possible


def _check_finite(place: Place, what: str, values: np.ndarray) -> None:
    if not np.all(np.isfinite(values)):
        raise place.error(f"{what} is not finite", "give finite numbers")
    if np.abs(values).max() > LARGEST:
        raise place.error(f"{what} holds {np.abs(values).max():g}", f"give numbers of less than {LARGEST:g}")


def _check_axes(joint: JointDescription) -> None:
    for name, axis in (("axis", joint.axis), ("axis2", joint.axis2)):
        if axis is None:
            continue
        _check_finite(joint.place, name, axis)
        if joint.kind != "fixed" and np.linalg.norm(axis) < 1e-9:
            raise joint.place.error(f"{name} is the zero vector", f'give <{name} xyz="…"/> a direction')
    if joint.kind != "universal":
        if joint.axis2 is not None:
            raise joint.place.error(f"a {joint.kind} joint has no second axis", "leave axis2 out, or make it universal")
        return
    if joint.axis2 is None:
        raise joint.place.error("a universal joint needs a second axis", 'give <axis2 xyz="…"/>')
    sine = np.linalg.norm(np.cross(joint.axis, joint.axis2))
    if sine < 1e-3 * np.linalg.norm(joint.axis) * np.linalg.norm(joint.axis2):
        raise joint.place.error("its two axes are parallel", "turn one of them, or make the joint revolute")


def _check_numbers(joint: JointDescription) -> None:
    place, limits = joint.place, joint.limits
    for name in ("damping", "friction", "armature"):
        value = getattr(joint, name)
        if not math.isfinite(value) or value < 0.0:
            raise place.error(f"{name} is {value:g}", "give a finite number, zero or more")
    if math.isnan(limits.lower) or math.isnan(limits.upper) or limits.lower > limits.upper:
        raise place.error(f"lower limit {limits.lower:g} is not below upper limit {limits.upper:g}", "exchange or correct them")
    if joint.kind == "ball" and limits.upper < 0.0:
        raise place.error(f"upper limit of a ball joint is {limits.upper:g}", "give how far it may turn, zero or more")
    if limits.ball is not None:
        if not isinstance(limits.ball, SwingTwist):
            raise place.error(f"limits of a ball joint are {limits.ball!r}", "give an articulated.SwingTwist")
        if joint.kind != "ball":
            raise place.error(f"a {joint.kind} joint has no swing and twist", "give lower and upper limits, or make it a ball")
        if math.isfinite(limits.upper):
            raise place.error("has both an upper limit and a swing and twist", "leave one of them out")
    for name in ("effort", "velocity", "acceleration", "deceleration", "jerk"):
        value = getattr(limits, name)
        if math.isnan(value) or value < 0.0:
            raise place.error(f"{name} limit is {value:g}", "give a number, zero or more")
    ends = [abs(end) for end in (limits.lower, limits.upper) if math.isfinite(end)]
    if joint.kind in ("revolute", "universal", "ball") and any(end > LARGEST_LIMIT for end in ends):
        place.warn(f"may turn by {max(ends):g} rad", "units are radians; were these degrees?")
    if joint.kind == "prismatic" and any(end > FARTHEST for end in ends):
        place.warn(f"may slide by {max(ends):g} m", "units are metres; were these millimetres?")
