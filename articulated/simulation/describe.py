"""From what users describe to the scene that a step is compiled from, and its numbers."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from articulated.dynamics.boundary import find_link
from articulated.dynamics.loops.closure import closures
from articulated.dynamics.loops.functions import own_loops
from articulated.dynamics.mechanism import WORLD
from articulated.rig import Loop, Rig
from articulated.rig.errors import RigWarning
from articulated.scalar import flatten, rebuilt
from articulated.simulation.actuation import PD, Gains, Stops, gains
from articulated.simulation.contact.candidates import ContactPoint, candidates
from articulated.simulation.contact.choosing import chosen, name_of
from articulated.simulation.contact.collisions import Collisions
from articulated.simulation.contact.ground import Ground, Material
from articulated.simulation.contact.meeting import Pair
from articulated.simulation.scene import DriveNumbers, MaterialNumbers, Numbers, Scene

DEPTH = 5e-4
"""How deep a rig's whole weight on one point sinks in, where no stiffness is given [m]."""
_WEIGHT = 9.81


def described(
    rig: Rig,
    ground: Ground | bool | None,
    points: Sequence[ContactPoint | str] | None,
    limits: Stops | bool,
    actuation: PD | None,
    tolerance: float,
    loops: Sequence[Loop] | None = None,
    collisions: Collisions | bool | None = None,
) -> tuple[Scene, Numbers, np.ndarray]:
    """The scene, the structure of its numbers, and their values, shape (..., n).

    Raises:
        ValueError: something is of the wrong kind, or does not fit the rig.
    """
    ground = Ground() if ground is True else None if ground is False else ground
    _check_kind("ground", ground, Ground, "a Ground, True or None")
    if not isinstance(collisions, bool):
        _check_kind("collisions", collisions, Collisions, "a Collisions, True or None")
    _check_kind("actuation", actuation, PD, "a PD or None")
    stops = Stops() if limits is True else None if limits is False else limits
    _check_kind("limits", stops, Stops, "True, False or Stops")
    driven = gains(rig, actuation) if actuation is not None else None
    scene, materials = _scene(rig, ground, points, stops, driven)
    some = closures(rig, own_loops(rig, loops))
    if collisions is not None and collisions is not False:
        scene, materials = _with_pairs(scene, materials, Collisions() if collisions is True else collisions)
    scene = replace(scene, loops=tuple(x for x in some if not x.one_sided), ropes=tuple(x for x in some if x.one_sided))
    none = np.zeros(0)
    p, d, limit = (driven.stiffness, driven.damping, driven.limit) if driven else (none, none, none)
    stop = stops or Stops()
    parts = [[x for material in materials for x in _numbers(rig, material)]]
    parts += [[stop.stiffness, stop.dissipation, stop.restitution], p, d, limit, [tolerance]]
    batch = np.broadcast_shapes(*(np.shape(part)[:-1] for part in parts))
    numbers = np.concatenate([np.broadcast_to(part, (*batch, np.shape(part)[-1])) for part in parts], axis=-1)
    like = Numbers(
        [MaterialNumbers(0.0, 0.0, 0.0, 0.0) for _ in materials],
        drives=DriveNumbers(*([0.0] * part.shape[-1] for part in (p, d, limit))),
    )
    assert len(flatten(like)) == numbers.shape[-1]
    return scene, rebuilt(like, iter(flatten(like))), numbers


def _scene(
    rig: Rig, ground: Ground | None, points: Sequence[ContactPoint | str] | None, stops: Stops | None, driven: Gains | None
) -> tuple[Scene, list[Material]]:
    drives = driven.drives if driven else None
    rebounds = stops is not None and stops.restitution > 0.0
    if ground is None:
        return Scene(rig, stops=stops is not None, rebounds=rebounds, drives=drives), []
    some = candidates(rig, points)
    if not some:
        warnings.warn(
            f"rig {rig.name!r} has no collision shape on a link that moves: it falls through the ground; give its links"
            " collision shapes, or the simulation contact_points=[art.ContactPoint(…), …]",
            RigWarning,
            stacklevel=5,
        )
    names = list(rig.links)
    special = [find_link(rig, name).name for name in ground.materials]
    materials = [ground.material, *ground.materials.values()]
    which = tuple(1 + special.index(name) if (name := names[c.link]) in special else 0 for c in some)
    scene = Scene(
        rig,
        ground.solids,
        some,
        which,
        len(materials),
        ground.velocity,
        rebounds or any(material.restitution > 0.0 for material in materials),
        stops is not None,
        drives,
    )
    return scene, materials


def _with_pairs(scene: Scene, materials: list[Material], collisions: Collisions) -> tuple[Scene, list[Material]]:
    """A scene in which bodies touch each other too."""
    rig, choice = scene.rig, chosen(scene.rig, collisions)
    first, special = len(materials), list(collisions.materials)
    own = [collisions.material, *collisions.materials.values()]
    pairs = []
    for i, j in choice.pairs:
        links = name_of(rig, choice.pieces[i]), name_of(rig, choice.pieces[j])
        matching = [k for k, pair in enumerate(special, 1) if choice.names.match(links, [pair])]
        a, b = (j, i) if choice.pieces[i].body(scene.mechanism) == WORLD else (i, j)
        pairs.append(Pair(a, b, first + max(matching, default=0)))
    rebounds = scene.rebounds or any(material.restitution > 0.0 for material in own)
    materials = [*materials, *own]
    scene = replace(scene, pieces=choice.pieces, pairs=tuple(pairs), materials=len(materials), rebounds=rebounds)
    return scene, materials


def _numbers(rig: Rig, material: Material) -> tuple[float, ...]:
    stiffness = max(rig.mass, 1e-30) * _WEIGHT / DEPTH if material.stiffness is None else material.stiffness
    return material.friction, material.restitution, stiffness, material.dissipation


def _check_kind(name: str, value, kind: type, expected: str) -> None:
    if value is not None and not isinstance(value, kind):
        raise ValueError(f"{name} is {value!r}; expected {expected}")
