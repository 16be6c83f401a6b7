"""Weights that a source leaves out: links without an <inertial> weighed by their shapes, rigs scaled to what they weigh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from articulated.rig.description import LinkDescription
from articulated.rig.errors import Place
from articulated.rig.mass import check_positive, mass_properties
from articulated.rig.rig import Rig


def filled(links: Sequence[LinkDescription], density: float, repair_mesh: str | None, place: Place) -> list[LinkDescription]:
    """The links, those without mass given that of their collision shapes; which ones, one `RigWarning` says.

    A link with a mass keeps it, and one without collision shapes stays a frame.

    Raises:
        ValueError: the density is not a positive number.
        RigError: the shapes of a link bound no solid.
    """
    check_positive("density", density, "kilograms a cubic metre")
    result, names = [], []
    for link in links:
        if link.mass == 0.0 and link.collisions:
            link = _weighed(link, density, repair_mesh)
            names.append(repr(link.name))
        result.append(link)
    if names:
        which = f"link {names[0]} has" if len(names) == 1 else f"links {', '.join(names)} have"
        place.warn(f"{which} no <inertial>", f"its place is taken by their collision shapes at {density:g} kg/m³")
    return result


def scaled(rig: Rig, total_mass: float) -> Rig:
    """The rig with every mass and every inertia multiplied alike, so that `Rig.mass` is `total_mass`.

    Links fixed to the world are multiplied too, to keep their density, but do not count: they are not in `Rig.mass`.
    Damping, friction, armature and limits stay as they are.

    Raises:
        ValueError: the mass is not a positive number, or nothing of the rig moves.
    """
    check_positive("total_mass", total_mass, "kilograms")
    if rig.mass == 0.0:
        raise ValueError(f"total_mass is {total_mass!r}, but nothing of rig {rig.name!r} moves; give a root of 'free'")
    factor = float(total_mass) / rig.mass
    bodies = tuple(replace(body, mass=factor * body.mass, inertia=_times(factor, body.inertia)) for body in rig.bodies)
    links = {
        name: replace(link, mass=factor * link.mass, inertia=_times(factor, link.inertia)) for name, link in rig.links.items()
    }
    return replace(rig, bodies=bodies, links=MappingProxyType(links))


def _weighed(link: LinkDescription, density: float, repair_mesh: str | None) -> LinkDescription:
    try:
        solid = mass_properties(link.collisions, density, repair_mesh=repair_mesh)
    except ValueError as error:
        raise link.place.error(f"its collision shapes cannot be weighed: {error}", "or give it an <inertial>") from None
    return replace(link, mass=solid.mass, center=solid.center, inertia=solid.inertia)


def _times(factor: float, inertia: np.ndarray) -> np.ndarray:
    result = factor * inertia
    result.flags.writeable = False
    return result
