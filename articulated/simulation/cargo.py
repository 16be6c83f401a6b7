"""Particles that the states of a batch carry: what a rig feels of them in a step, and where they go then.

Each step has three parts: particles are given up down to their roots, the rig takes its step with what these weigh and how they
pull, and particles follow the velocities that it found. Then what ran into something is put back outside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from articulated.dynamics.functions import link_poses, link_velocities
from articulated.particles.colliders import Collider
from articulated.particles.collisions import collided
from articulated.particles.points import vectors
from articulated.particles.roots import Roots
from articulated.particles.solvers.implicit import ImplicitEuler
from articulated.particles.system import System
from articulated.simulation.freight import Freight, Lot, inside, to

_LOOSE = ImplicitEuler(turns=1)
"""The step of what no link carries: that of what one does."""


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
        self._poses: np.ndarray | None = None  # of links, where they went last

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
        self._poses = link_poses(rig, q) if self._poses is None else self._poses
        twists = link_velocities(rig, q, v)
        some = zip(
            self._loads, *(_flat(array, 1 + k, self._batch) for k, array in ((2, self._poses), (1, twists))), strict=True
        )
        return np.array([load.towed(poses, twists, h) for load, poses, twists in some]).reshape(*self._batch, -1)

    def follow(self, q: np.ndarray, towing: np.ndarray) -> None:
        """Go where the rig went, with the velocities of its bodies that it found, shape (*batch, 6 bodies)."""
        assert self._poses is not None
        before, after = _flat(self._poses, 3, self._batch), link_poses(self._freight.rig, q.astype(float, copy=False))
        self._poses = after
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
            Roots(system, lot.roots, lot.owners, len(lot.bodies)) if lot.bodies else None
            for system, lot in zip(self._systems, self._lots, strict=True)
        ]

    @property
    def particles(self) -> np.ndarray:
        return np.concatenate([np.concatenate([system.x, system.v], axis=1) for system in self._systems])

    def towed(self, poses: np.ndarray, twists: np.ndarray, h: float) -> np.ndarray:
        point, self._h = poses[next((lot.links[0] for lot in self._lots if lot.bodies), 0), :3, 3], h
        numbers = [point]
        for lot, system, roots in zip(self._lots, self._systems, self._roots, strict=True):
            if roots is None:
                continue
            system.x[lot.roots] = lot.at(poses)
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
            if roots is None:
                system.step(self._h, _LOOSE)  # and past what stands still
            else:
                roots.follow(found[first : first + size], lot.at(new))
                first += size
                self._pass(lot, system, before)
            self._avoid(lot, system, before, old, new)

    def _pass(self, lot: Lot, system: System, before: tuple[np.ndarray, np.ndarray]) -> None:
        """Keep particles out of what they ran into that stands still, in a step that is over."""
        if system.colliders:
            t, free = system.time - self._h, self._free(lot, system)
            system.x, system.v = _past(system.colliders, t, self._h, *before, system.x, system.v, free)

    def _avoid(self, lot: Lot, system: System, before: tuple[np.ndarray, np.ndarray], old: np.ndarray, new: np.ndarray) -> None:
        """Keep particles out of links that they ran into."""
        free, (x0, v0) = self._free(lot, system), before
        for link, pose, obstacle in lot.obstacles:
            X0, X1 = old[link] @ pose, new[link] @ pose
            y0, y1 = inside(X0, x0), inside(X1, system.x)
            reach = obstacle.reach + np.linalg.norm(y1 - y0, axis=1)
            some = np.flatnonzero(free & (np.linalg.norm(y1, axis=1) < reach))
            if len(some):
                self._keep_out(system, obstacle, (X0, X1), some, v0, (y0[some], y1[some]))

    @staticmethod
    def _free(lot: Lot, system: System) -> np.ndarray:
        """Which are carried by none."""
        free = system.inverse_mass > 0.0
        free[lot.roots] = False
        return free

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
        w0 = (v0[some] - (to(X1, y0) - to(X0, y0)) / h) @ X0[:3, :3]
        carried = (to(X1, y1) - to(X0, y1)) / h
        w1 = (system.v[some] - carried) @ X1[:3, :3]
        y, w = _past([obstacle], 0.0, h, y0, w0, y1, w1, np.ones(len(some), dtype=bool))
        hit = (y != y1).any(axis=1) | (w != w1).any(axis=1)
        where, y, w = some[hit], y[hit], w[hit]
        system.x[where] = to(X1, y)
        system.v[where] = w @ X1[:3, :3].T + (to(X1, y) - to(X0, y)) / h


def _past(
    colliders: Sequence[Collider],
    t: float,
    h: float,
    x: np.ndarray,
    v: np.ndarray,
    new_x: np.ndarray,
    new_v: np.ndarray,
    free: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """As `collided`, of rows."""
    found = collided(colliders, t, h, vectors(x), vectors(v), vectors(new_x), vectors(new_v), free)
    return np.stack(list(found[0]), axis=1), np.stack(list(found[1]), axis=1)


def _flat(array: np.ndarray, core: int, batch: tuple[int, ...]) -> np.ndarray:
    own = array.shape[array.ndim - core :]
    return np.broadcast_to(array, (*batch, *own)).reshape(math.prod(batch), *own)
