"""Particles that a rig carries, as a run takes them: which bodies bear them, where they start, and what they run into."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from articulated.dynamics.boundary import find_link
from articulated.dynamics.functions import link_poses, link_velocities
from articulated.dynamics.mechanism import WORLD, mechanism
from articulated.particles.attached import Attached
from articulated.particles.colliders import Box, Capsule, Collider, Plane, Sphere
from articulated.particles.convex import Cylinder, Hull
from articulated.particles.forces.gravity import Gravity
from articulated.particles.height_field import HeightField
from articulated.particles.system import System
from articulated.rig import Rig
from articulated.rig import shapes as rig_shapes
from articulated.rig.mesh import found_mesh, read_mesh
from articulated.simulation.contact import surfaces
from articulated.simulation.contact.ground import Ground

_FAR = 1e3
"""How far stairs go on [m]."""


@dataclass(frozen=True, eq=False)
class Lot:
    """Particles that were attached together, and what carries them.

    Attributes:
        attached: as it was given.
        bodies: that carry roots and move.
        roots: those that they carry, with the link of each, its owner among the bodies, and its place in the link.
        held: roots that links carry which do not move.
        carrier: link in whose axes all particles start, and their places there; None is the world.
        obstacles: shapes of links that they cannot enter: the link, the shape's pose in it, and what it is.
        system: they, at rest.
    """

    attached: Attached
    bodies: tuple[int, ...]
    roots: np.ndarray
    links: np.ndarray
    owners: np.ndarray
    places: np.ndarray
    held: np.ndarray
    carrier: int | None
    x: np.ndarray
    obstacles: tuple[tuple[int, np.ndarray, Collider], ...]
    system: System

    @staticmethod
    def of(rig: Rig, attached: Attached, gravity: Sequence[float], ground: Sequence[Collider]) -> Lot:
        """On a rig, under an acceleration of free fall, above a ground.

        Raises:
            ValueError: it has no such link, or there are roots but nothing that carries one moves.
        """
        m, neutral = mechanism(rig), link_poses(rig, rig.neutral())
        links = {find_link(rig, name).index: some for name, some in attached.roots.items()}
        frame = attached.frame
        x = attached.x if frame is None else to(neutral[find_link(rig, frame).index], attached.x)
        carrier = next(iter(links), None) if frame is None else find_link(rig, frame).index
        body = {k: m.links[k][0] for k in links}
        bodies = tuple(dict.fromkeys(i for i in body.values() if i != WORLD))
        if links and not bodies:
            raise ValueError(
                f"no link of rig {rig.name!r} that carries particles moves: {', '.join(attached.roots)};"
                " give the particles a System of their own, with these pinned"
            )
        moving = [(k, n) for k, some in links.items() if body[k] != WORLD for n in some]
        of, roots = np.array([(k, n) for k, n in moving], dtype=np.int64).reshape(-1, 2).T
        held = np.array([n for k, some in links.items() if body[k] == WORLD for n in some], dtype=np.int64)
        places = np.array([inside(neutral[k], x[n]) for k, n in moving]).reshape(-1, 3)
        owners = np.array([bodies.index(body[k]) for k in of], dtype=np.int64)
        obstacles = tuple(_obstacles(rig, attached))
        colliders = [*attached.colliders, *ground]
        system = System(x, None, attached.mass, [Gravity(gravity), *attached.forces], colliders, held)
        x = x if carrier is None else inside(neutral[carrier], x)
        return Lot(attached, bodies, roots, of, owners, places, held, carrier, x, obstacles, system)

    def at(self, poses: np.ndarray) -> np.ndarray:
        """Where links have the roots, shape (..., roots, 3), from poses of all links."""
        own = poses[..., self.links, :, :]
        return np.einsum("...nij,nj->...ni", own[..., :3, :3], self.places) + own[..., :3, 3]


@dataclass(frozen=True, eq=False)
class Freight:
    """All that a rig carries.

    Attributes:
        rig: the rig.
        lots: what is attached to it.
    """

    rig: Rig
    lots: tuple[Lot, ...]

    @staticmethod
    def of(rig: Rig, attached: Sequence[Attached], gravity: Sequence[float], ground: Ground | None) -> Freight:
        """See `Lot.of`."""
        under = list(_grounds(ground)) if ground is not None else []
        return Freight(rig, tuple(Lot.of(rig, some, gravity, under) for some in attached))

    @property
    def carriers(self) -> tuple[tuple[int, ...], ...]:
        """Of each lot the bodies that carry it."""
        return tuple(lot.bodies for lot in self.lots)

    @cached_property
    def ends(self) -> np.ndarray:
        """Where each lot's particles begin among all, and where the last end."""
        return np.cumsum([0, *(len(lot.x) for lot in self.lots)])

    @property
    def segments(self) -> np.ndarray:
        """Pairs of particles, to be drawn, shape (m, 2)."""
        return np.concatenate([lot.attached.segments + n for lot, n in zip(self.lots, self.ends, strict=False)])

    def placed(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Where links take all particles, and how fast: x, then v, shape (..., n, 6)."""
        poses, twists = link_poses(self.rig, q), link_velocities(self.rig, q, v)
        result = np.empty((*q.shape[:-1], int(self.ends[-1]), 6))
        for lot, first in zip(self.lots, self.ends, strict=False):
            here = slice(first, first + len(lot.x))
            if lot.carrier is None:
                result[..., here, :3], result[..., here, 3:] = lot.x, 0.0
                continue
            pose, twist = poses[..., lot.carrier, :, :], twists[..., lot.carrier, None, :]
            x = np.einsum("...ij,nj->...ni", pose[..., :3, :3], lot.x) + pose[..., None, :3, 3]
            result[..., here, :3] = x
            result[..., here, 3:] = twist[..., :3] + np.cross(twist[..., 3:], x - pose[..., None, :3, 3])
            at, own = lot.at(poses), twists[..., lot.links, :]
            result[..., first + lot.roots, :3] = at
            turned = np.cross(own[..., 3:], at - poses[..., :3, 3][..., lot.links, :])
            result[..., first + lot.roots, 3:] = own[..., :3] + turned
            result[..., first + lot.held, :3], result[..., first + lot.held, 3:] = lot.system.x[lot.held], 0.0
        return result

    def energy(self, time: np.ndarray, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Kinetic and potential, of frames of shape (..., T, n, 3), shape (..., T) [J]."""
        result = np.zeros(x.shape[:-2])
        for frame in np.ndindex(result.shape):
            for lot, first in zip(self.lots, self.ends, strict=False):
                own = slice(first, first + len(lot.x))
                result[frame] += lot.system.energy(float(time[frame[-1]]), x[frame][own], v[frame][own])
        return result

    @property
    def triangles(self) -> np.ndarray:
        """Between which there is cloth, shape (k, 3)."""
        return np.concatenate([lot.attached.triangles + n for lot, n in zip(self.lots, self.ends, strict=False)])


def _obstacles(rig: Rig, attached: Attached) -> Iterator[tuple[int, np.ndarray, Collider]]:
    """Shapes of links that particles avoid."""
    for name in attached.avoids:
        link = find_link(rig, name)
        if not link.collisions:
            raise ValueError(
                f"link {name!r} of rig {rig.name!r} has no collision shape that particles could avoid; leave it out"
            )
        for shape in link.collisions:
            collider = collider_of(shape.geometry, name, attached.restitution, attached.friction)
            if collider is not None:
                yield link.index, shape.pose, collider


def _grounds(ground: Ground) -> Iterator[Collider]:
    """What a ground is to particles; it stands still."""
    material = ground.material
    surface: dict[str, Any] = {"restitution": material.restitution, "friction": material.friction}
    for one in ground.surfaces if isinstance(ground.surfaces, tuple) else ():
        if isinstance(one, surfaces.HeightField):
            yield HeightField(one.heights, one.spacing, one.origin, **surface)
        elif isinstance(one, surfaces.Plane):
            yield Plane(one.normal, one.point, **surface)
        else:
            yield Plane((0.0, 0.0, 1.0), one.start, **surface)
            c, s = np.cos(one.heading), np.sin(one.heading)
            axes = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
            for k in range(one.count):  # each with all that is below and behind it
                edge = np.array(one.start) + axes @ (k * one.run, 0.0, (k + 1) * one.rise)
                yield Box(edge + axes @ (0.5 * _FAR, 0.0, -0.5 * _FAR), (_FAR, _FAR, _FAR), axes, **surface)


def collider_of(geometry: rig_shapes.Geometry, link: str, restitution: float, friction: float) -> Collider | None:
    """What a shape is to particles, in its own axes."""
    surface: dict[str, Any] = {"restitution": restitution, "friction": friction}
    if isinstance(geometry, rig_shapes.Sphere):
        return Sphere((0.0, 0.0, 0.0), geometry.radius, **surface)
    if isinstance(geometry, rig_shapes.Box):
        return Box((0.0, 0.0, 0.0), geometry.size, **surface)
    if isinstance(geometry, rig_shapes.Capsule):
        half = 0.5 * geometry.length
        return Capsule([(0.0, 0.0, -half), (0.0, 0.0, half)], geometry.radius, **surface)
    if isinstance(geometry, rig_shapes.Cylinder):
        return Cylinder(geometry.radius, geometry.length, **surface)
    path = found_mesh(geometry, f"of link {link!r}")
    return None if path is None else Hull(read_mesh(path).vertices * np.asarray(geometry.scale), **surface)


def to(X: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Points out of a frame."""
    return x @ X[:3, :3].T + X[:3, 3]


def inside(X: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Points in a frame."""
    return (x - X[:3, 3]) @ X[:3, :3]
