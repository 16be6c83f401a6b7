"""Particles that the states of a batch carry: what a rig feels of them in a step, and where they go then.

Each step has three parts: particles are given up down to their roots, the rig takes its step with what these weigh and how they
pull, and particles follow the velocities that it found. Then what ran into something is put back outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from articulated.dynamics.boundary import find_link
from articulated.dynamics.functions import link_poses, link_velocities
from articulated.dynamics.mechanism import WORLD, mechanism
from articulated.particles.attached import Attached
from articulated.particles.colliders import Box, Capsule, Collider, Sphere
from articulated.particles.collisions import collided
from articulated.particles.convex import Cylinder, Hull, radius_of
from articulated.particles.forces.gravity import Gravity
from articulated.particles.points import vectors
from articulated.particles.roots import Roots
from articulated.particles.system import System
from articulated.rig import Rig
from articulated.rig import shapes as rig_shapes
from articulated.rig.mesh import found_mesh, read_mesh


@dataclass(frozen=True, eq=False)
class Lot:
    """Particles that were attached together, and what carries them.

    Attributes:
        attached: as it was given.
        bodies: that carry roots and move.
        roots: those that they carry, with the link of each, its owner among the bodies, and its place in the link.
        held: roots that links carry which do not move.
        carrier: link in whose axes all particles start, and their places there.
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
    carrier: int
    x: np.ndarray
    obstacles: tuple[tuple[int, np.ndarray, Collider], ...]
    system: System

    @staticmethod
    def of(rig: Rig, attached: Attached, gravity: Sequence[float]) -> Lot:
        """On a rig, under an acceleration of free fall.

        Raises:
            ValueError: it has no such link, or nothing that carries a root moves.
        """
        m, neutral = mechanism(rig), link_poses(rig, rig.neutral())
        links = {find_link(rig, name).index: some for name, some in attached.roots.items()}
        frame = attached.frame
        x = attached.x if frame is None else _to(neutral[find_link(rig, frame).index], attached.x)
        carrier = next(iter(links)) if frame is None else find_link(rig, frame).index
        body = {k: m.links[k][0] for k in links}
        bodies = tuple(dict.fromkeys(i for i in body.values() if i != WORLD))
        if not bodies:
            raise ValueError(
                f"no link of rig {rig.name!r} that carries particles moves: {', '.join(attached.roots)};"
                " give the particles a System of their own, with these pinned"
            )
        moving = [(k, n) for k, some in links.items() if body[k] != WORLD for n in some]
        of, roots = np.array([k for k, _ in moving]), np.array([n for _, n in moving])
        held = np.array([n for k, some in links.items() if body[k] == WORLD for n in some], dtype=np.int64)
        places = np.array([_from(neutral[k], x[n]) for k, n in moving])
        owners = np.array([bodies.index(body[k]) for k in of])
        obstacles = tuple(_obstacles(rig, attached))
        system = System(x, None, attached.mass, [Gravity(gravity), *attached.forces], attached.colliders, held)
        return Lot(attached, bodies, roots, of, owners, places, held, carrier, _from(neutral[carrier], x), obstacles, system)


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
    def of(rig: Rig, attached: Sequence[Attached], gravity: Sequence[float]) -> Freight:
        """See `Lot.of`."""
        return Freight(rig, tuple(Lot.of(rig, some, gravity) for some in attached))

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
        some = [lot.attached.segments + first for lot, first in zip(self.lots, self.ends, strict=False)]
        return np.concatenate(some) if some else np.zeros((0, 2), dtype=np.int64)

    def placed(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Where links take all particles, and how fast: x, then v, shape (..., n, 6)."""
        poses, twists = link_poses(self.rig, q), link_velocities(self.rig, q, v)
        result = np.empty((*q.shape[:-1], int(self.ends[-1]), 6))
        for lot, first in zip(self.lots, self.ends, strict=False):
            pose, twist = poses[..., lot.carrier, :, :], twists[..., lot.carrier, None, :]
            here = slice(first, first + len(lot.x))
            x = np.einsum("...ij,nj->...ni", pose[..., :3, :3], lot.x) + pose[..., None, :3, 3]
            result[..., here, :3] = x
            result[..., here, 3:] = twist[..., :3] + np.cross(twist[..., 3:], x - pose[..., None, :3, 3])
            for k, (n, link) in enumerate(zip(lot.roots, lot.links, strict=True)):
                at = np.einsum("...ij,j->...i", poses[..., link, :3, :3], lot.places[k])
                result[..., first + n, :3] = at + poses[..., link, :3, 3]
                result[..., first + n, 3:] = twists[..., link, :3] + np.cross(twists[..., link, 3:], at)
            result[..., first + lot.held, 3:] = 0.0
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
        some = [lot.attached.triangles + first for lot, first in zip(self.lots, self.ends, strict=False)]
        return np.concatenate(some) if some else np.zeros((0, 3), dtype=np.int64)


class Cargo:
    """What the states of a batch carry, under way.

    Attributes:
        particles: x, then v of all particles, shape (*batch, n, 6).
    """

    def __init__(self, freight: Freight, particles: np.ndarray, time: float):
        self._freight = freight
        self._batch = particles.shape[:-2]
        flat = particles.reshape(-1, *particles.shape[-2:])
        self._loads = [_Load(freight, state, time) for state in flat]
        self._poses = np.zeros(0)

    @property
    def particles(self) -> np.ndarray:
        """X, then v, of all particles."""
        some = [load.particles for load in self._loads]
        size = int(self._freight.ends[-1])
        return np.array(some).reshape(*self._batch, size, 6)

    def towed(self, q: np.ndarray, v: np.ndarray, h: float) -> np.ndarray:
        """What it does to the rig in a step, as `implicit.towing` has it, shape (*batch, size)."""
        rig = self._freight.rig
        q, v = q.astype(float, copy=False), v.astype(float, copy=False)
        self._poses, twists = link_poses(rig, q), link_velocities(rig, q, v)
        some = zip(
            self._loads, *(_flat(array, 1 + k, self._batch) for k, array in ((2, self._poses), (1, twists))), strict=True
        )
        return np.array([load.towed(poses, twists, h) for load, poses, twists in some]).reshape(*self._batch, -1)

    def follow(self, q: np.ndarray, towing: np.ndarray) -> None:
        """Go where the rig went, with the velocities of its bodies that it found, shape (*batch, 6 bodies)."""
        before, after = _flat(self._poses, 3, self._batch), link_poses(self._freight.rig, q.astype(float, copy=False))
        some = zip(self._loads, before, _flat(after, 3, self._batch), _flat(towing, 1, self._batch), strict=True)
        for load, old, new, found in some:
            load.follow(old, new, found)


class _Load:
    """What one state carries."""

    def __init__(self, freight: Freight, particles: np.ndarray, time: float):
        self._lots, self._h = freight.lots, 0.0
        self._systems = []
        for lot, first in zip(freight.lots, freight.ends, strict=False):
            own = particles[first : first + len(lot.x)]
            self._systems.append(lot.system.at(own[:, :3], own[:, 3:], time))
        self._roots = [
            Roots(system, lot.roots, lot.owners, len(lot.bodies)) for system, lot in zip(self._systems, self._lots, strict=True)
        ]

    @property
    def particles(self) -> np.ndarray:
        return np.concatenate([np.concatenate([system.x, system.v], axis=1) for system in self._systems])

    def towed(self, poses: np.ndarray, twists: np.ndarray, h: float) -> np.ndarray:
        point, self._h = poses[self._lots[0].links[0], :3, 3], h
        numbers = [point]
        for lot, system, roots in zip(self._lots, self._systems, self._roots, strict=True):
            system.x[lot.roots] = _of_links(poses, lot)
            U = np.concatenate([self._twist(lot, i, poses, twists, point) for i in range(len(lot.bodies))])
            felt = roots.felt(h, point, U)
            numbers += [felt.inertia[np.triu_indices(len(U))], felt.impulse]
        return np.concatenate(numbers)

    @staticmethod
    def _twist(lot: Lot, owner: int, poses: np.ndarray, twists: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Of a body, (angular, linear) about a point."""
        link = lot.links[np.argmax(lot.owners == owner)]
        linear, angular = twists[link, :3], twists[link, 3:]
        return np.concatenate([angular, linear + np.cross(angular, point - poses[link, :3, 3])])

    def follow(self, old: np.ndarray, new: np.ndarray, found: np.ndarray) -> None:
        first = 0
        for lot, system, roots in zip(self._lots, self._systems, self._roots, strict=True):
            size = 6 * len(lot.bodies)
            before = system.x.copy(), system.v.copy()
            roots.follow(found[first : first + size], _of_links(new, lot))
            first += size
            self._collide(lot, system, before, old, new)

    def _collide(
        self, lot: Lot, system: System, before: tuple[np.ndarray, np.ndarray], old: np.ndarray, new: np.ndarray
    ) -> None:
        """Keep particles out of what they ran into, in a step that is over."""
        free, t = system.inverse_mass > 0.0, system.time - self._h
        free[lot.roots] = False
        (x0, v0), h = before, self._h
        if lot.attached.colliders:
            x, v = _past(lot.attached.colliders, t, h, x0, v0, system.x, system.v)
            system.x, system.v = np.where(free[:, None], x, system.x), np.where(free[:, None], v, system.v)
        for link, pose, obstacle in lot.obstacles:
            X0, X1 = old[link] @ pose, new[link] @ pose
            y0, y1 = _from(X0, x0), _from(X1, system.x)
            reach = radius_of(obstacle) + np.linalg.norm(y1 - y0, axis=1)
            some = np.flatnonzero(free & (np.linalg.norm(y1, axis=1) < reach))
            if len(some):
                self._keep_out(system, obstacle, (X0, X1), some, v0, (y0[some], y1[some]))

    def _keep_out(
        self,
        system: System,
        obstacle: Collider,
        poses: tuple[np.ndarray, np.ndarray],
        some: np.ndarray,
        v0: np.ndarray,
        ways: tuple[np.ndarray, np.ndarray],
    ) -> None:
        """In the axes of something that moves, where it stands still and particles move past it."""
        (X0, X1), (y0, y1), h = poses, ways, self._h
        w0 = (v0[some] - (_to(X1, y0) - _to(X0, y0)) / h) @ X0[:3, :3]
        carried = (_to(X1, y1) - _to(X0, y1)) / h
        w1 = (system.v[some] - carried) @ X1[:3, :3]
        y, w = _past([obstacle], 0.0, h, y0, w0, y1, w1)
        hit = (y != y1).any(axis=1) | (w != w1).any(axis=1)
        where, y, w = some[hit], y[hit], w[hit]
        system.x[where] = _to(X1, y)
        system.v[where] = w @ X1[:3, :3].T + (_to(X1, y) - _to(X0, y)) / h


def _past(
    colliders: Sequence[Collider], t: float, h: float, x: np.ndarray, v: np.ndarray, new_x: np.ndarray, new_v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As `collided`, of rows."""
    found = collided(colliders, t, h, vectors(x), vectors(v), vectors(new_x), vectors(new_v))
    return np.stack(list(found[0]), axis=1), np.stack(list(found[1]), axis=1)


def _of_links(poses: np.ndarray, lot: Lot) -> np.ndarray:
    """Where links have a lot's roots, shape (roots, 3)."""
    own = poses[lot.links]
    return np.einsum("nij,nj->ni", own[:, :3, :3], lot.places) + own[:, :3, 3]


def _obstacles(rig: Rig, attached: Attached):
    for name in attached.avoids:
        link = find_link(rig, name)
        if not link.collisions:
            raise ValueError(
                f"link {name!r} of rig {rig.name!r} has no collision shape that particles could avoid; leave it out"
            )
        for shape in link.collisions:
            collider = _collider(shape.geometry, name, attached.restitution, attached.friction)
            if collider is not None:
                yield link.index, shape.pose, collider


def _collider(geometry: rig_shapes.Geometry, link: str, restitution: float, friction: float) -> Collider | None:
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


def _to(X: np.ndarray, x: np.ndarray) -> np.ndarray:
    return x @ X[:3, :3].T + X[:3, 3]


def _from(X: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (x - X[:3, 3]) @ X[:3, :3]


def _flat(array: np.ndarray, core: int, batch: tuple[int, ...]) -> np.ndarray:
    return np.broadcast_to(array, (*batch, *array.shape[array.ndim - core :])).reshape(-1, *array.shape[array.ndim - core :])
