"""Particles that a rig carries: hair, a tail, a cape, a bag on a rope. `articulated.Simulation` moves both by one solution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from articulated.particles.builders import along_strands, shares
from articulated.particles.check import at_least_two, elements, in_range, numbers, per_element, positive, settle
from articulated.particles.colliders import Collider
from articulated.particles.forces.drag import Drag
from articulated.particles.forces.force import Force
from articulated.particles.forces.gravity import Gravity
from articulated.particles.shown import segments, triangles


@dataclass(frozen=True, eq=False)
class Attached:
    """Particles that go with a rig; some of them, the roots, are fixed to its links.

    What pulls at a root pulls at its link, and roots weigh on it: rig and particles are solved for together, both ways. Strands
    of one length whose first particles are the roots are quickest by far: see `hair_on`. Without roots they are loose, and fall
    on the links that they avoid.

    Attributes:
        x: where particles are at rest, shape (n, 3) [m], in the axes of a link or, if `frame` is None, in the world, with the
            rig in its neutral configuration.
        mass: a number or one for each, shape (n,) [kg].
        forces: what acts on them, but for gravity, which is the simulation's.
        roots: of each link that carries some, by name, the numbers of these.
        frame: name of the link in whose axes x is; particles start where it takes them. None: where the first link that carries
            some does, or where they are if none carries any.
        colliders: what they run into, in the world, besides the simulation's ground.
        avoids: names of links whose collision shapes they cannot enter; the links do not feel it.
        restitution, friction: of these shapes.
    """

    x: Any
    mass: Any
    forces: Sequence[Force]
    roots: Mapping[str, Any] = field(default_factory=dict)
    frame: str | None = None
    colliders: Sequence[Collider] = ()
    avoids: Sequence[str] = ()
    restitution: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        x = numbers("Attached: x", self.x, (None, 3))
        mass = np.broadcast_to(per_element("Attached: mass", self.mass, len(x)), len(x))
        if not (mass > 0.0).all():
            raise ValueError(f"Attached: mass[{int(np.argmin(mass))}] is zero; expected more: what a link carries has weight")
        if not isinstance(self.roots, Mapping):
            raise ValueError(f"Attached: roots is {self.roots!r}; expected names of links, each with the particles it carries")
        roots = {}
        for link, some in self.roots.items():
            found = elements(f"Attached: roots[{link!r}]", np.reshape(some, (-1, 1)), 1)
            if not len(found):
                raise ValueError(f"Attached: roots[{link!r}] is empty; give it a particle, or leave the link out")
            in_range(f"Attached: roots[{link!r}]", found, len(x))
            roots[link] = found[:, 0]
        every = np.concatenate([np.zeros(0, dtype=np.int64), *roots.values()])
        if len(np.unique(every)) != len(every):
            first = next(int(k) for k in every if (every == k).sum() > 1)
            raise ValueError(f"Attached: particle {first} is a root twice; one link carries it")
        if any(isinstance(force, Gravity) for force in self.forces):
            raise ValueError("Attached: forces has a Gravity; the simulation's acts on particles too: leave it out")
        for name in ("restitution", "friction"):
            settle(self, **{name: positive(f"Attached: {name}", getattr(self, name), zero=True)})
        avoids = (self.avoids,) if isinstance(self.avoids, str) else tuple(self.avoids)
        settle(self, x=x, mass=mass, forces=tuple(f.bound(x, mass) for f in self.forces), roots=roots, avoids=avoids)
        settle(self, colliders=tuple(self.colliders))

    @property
    def segments(self) -> np.ndarray:
        """Pairs of particles that a force joins, as they are drawn, shape (m, 2)."""
        return segments(self.forces)

    @property
    def triangles(self) -> np.ndarray:
        """Between which particles there is cloth, as it is drawn, shape (k, 3)."""
        return triangles(self.forces)


def hair_on(
    link: str,
    roots: Any,
    directions: Any,
    length: Any,
    particles: int,
    mass: Any,
    stiffness: float,
    bending: float = 0.0,
    damping: float = 0.0,
    drag: float = 0.0,
    wind: Any = None,
    colliders: Sequence[Collider] = (),
    avoids: Sequence[str] = (),
    friction: float = 0.0,
) -> Attached:
    """Straight strands on a link: hair, a ponytail, a tail, a fringe.

    Args:
        link: its name.
        roots: where strands begin, in the link's axes, shape (k, 3) [m].
        directions: where they point, shape (3,) or (k, 3), of any length.
        length: of a strand, a number or one for each, shape (k,) [m].
        particles: of each strand, 2 or more.
        mass: of a strand, likewise [kg].
        stiffness: E A: the force that would make a strand twice as long [N].
        bending: E I [N m²].
        damping: of stretching: the force at a strain rate of one [N s].
        drag: of each particle [N s/m].
        wind: a vector, or a function of time and place over scalars [m/s]; see `Drag`.
        colliders, avoids, friction: as of `Attached`.

    Raises:
        ValueError: a strand has no length or direction, or a number makes no sense.
    """
    start = numbers("hair_on: roots", roots, (None, 3))
    if not len(start):
        raise ValueError("hair_on: there are no roots; give at least one point")
    given = numbers("hair_on: directions", directions, (3,) if np.ndim(directions) == 1 else (len(start), 3))
    along = np.broadcast_to(given, start.shape)
    size = np.linalg.norm(along, axis=1)
    if not size.all():
        raise ValueError(f"hair_on: directions[{int(np.argmin(size))}] is the zero vector; give the strand a direction")
    n = at_least_two("hair_on: particles", particles)
    lengths, masses = (_of_each(f"hair_on: {name}", value, len(start)) for name, value in (("length", length), ("mass", mass)))
    way = np.linspace(0.0, 1.0, n)
    x = start[:, None] + way[:, None] * (along / size[:, None] * lengths[:, None])[:, None]
    number = np.arange(len(start) * n).reshape(-1, n)
    forces = along_strands("hair_on", number, lengths / (n - 1), stiffness, bending, damping)
    if positive("hair_on: drag", drag, zero=True) > 0.0:
        forces.append(Drag(drag, wind))
    elif wind is not None:
        raise ValueError("hair_on: there is wind but no drag, so nothing feels it; give drag")
    mass_of_each = (masses[:, None] * shares(n)).ravel()
    return Attached(x.reshape(-1, 3), mass_of_each, forces, {link: number[:, 0]}, link, colliders, avoids, friction=friction)


def _of_each(name: str, value: Any, count: int) -> np.ndarray:
    """A positive number for each of some things."""
    array = np.broadcast_to(per_element(name, value, count, "strand"), count)
    if not (array > 0.0).all():
        raise ValueError(f"{name} has an entry that is zero; expected more")
    return array
