"""A particle system: arrays of state, a list of what acts on them, and its phase space (Witkin and Baraff, 1997, C)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np

from articulated.particles.chains import Chains
from articulated.particles.check import all_are, format_of, mask, numbers, positive
from articulated.particles.colliders import Collider
from articulated.particles.collisions import collided
from articulated.particles.forces.force import Force
from articulated.particles.points import vectors
from articulated.particles.resident import Resident
from articulated.particles.shown import segments, triangles
from articulated.particles.steps import Solver, advance, method_of
from articulated.particles.sums import acting
from articulated.trajectory import Cloud


class System(Resident):
    """Particles, what acts on them, and what they run into.

    Its phase space has 6 n dimensions: all positions, then all velocities. If all arrays of x, v and mass are of float32, the
    state is too, and machine code computes in it; what has none yet computes in float64.

    Args:
        x: where they start, shape (n, 3) [m].
        v: their velocities, shape (n, 3) [m/s]; at rest if left out.
        mass: a number or one for each, shape (n,) [kg]; infinite pins a particle.
        forces: what acts on them.
        colliders: what they run into.
        pinned: numbers of particles that do not move, or a mask, shape (n,).
        time: [s].

    Attributes:
        x, v: the state, shape (n, 3). To look at them, or to change them, takes them out of machine code; so while many steps
            are taken one by one, look when you need to.
        mass: shape (n,) [kg]; zero for what is pinned, which has no weight either. It does not change: to let go of particles
            or pin some, make a system of the state that there is.
        inverse_mass: shape (n,) [1/kg]; zero for what is pinned; as little.
        pins: whether any particle is pinned.
        forces, colliders: see above; others may take their place: what these leave open is filled in from where particles are.
        time: see above.
        chains: if they are nothing but chains of one length, which; else None.
        like: the system that this one is a copy of, or itself: what it was made for serves its copies.

    Raises:
        ValueError: an array does not fit, a number is not finite, a mass is not positive, a pinned particle moves, or a force
            does not fit the particles.
    """

    def __init__(
        self,
        x: Any,
        v: Any = None,
        mass: Any = 1.0,
        forces: Sequence[Force] = (),
        colliders: Sequence[Collider] = (),
        pinned: Any = (),
        time: float = 0.0,
    ):
        dtype = format_of(x, v, mass)
        x = numbers("x", x, (None, 3))
        n = len(x)
        v = np.zeros((n, 3)) if v is None else numbers("v", v, (n, 3))
        super().__init__(x.astype(dtype), v.astype(dtype), float(numbers("time", time, ())))
        masses = np.broadcast_to(numbers("mass", mass, () if np.ndim(mass) == 0 else (n,), finite=False), n)
        if not (masses > 0.0).all():
            where = int(np.argmin(masses))
            raise ValueError(
                f"mass[{where}] is {masses[where]:g}; expected more than zero, or infinity for a particle that is pinned"
            )
        held = np.isinf(masses) | mask("pinned", pinned, n)
        moving = held & v.any(axis=1)
        if moving.any():
            where = int(np.argmax(moving))
            raise ValueError(f"v[{where}] is {v[where].tolist()}, but particle {where} is pinned; give it no velocity")
        self.inverse_mass = np.where(held, 0.0, 1.0 / masses)
        self.mass = np.where(held, 0.0, masses)
        self.mass.flags.writeable = self.inverse_mass.flags.writeable = False
        self.pins = bool(held.any())
        self.forces, self.colliders, self.like = forces, colliders, self

    def __repr__(self) -> str:
        return (
            f"System({len(self.x)} particles, {len(self.forces)} forces, {len(self.colliders)} colliders, t = {self.time:g} s)"
        )

    def at(self, x: np.ndarray, v: np.ndarray, time: float) -> System:
        """The same particles in another state, in float64."""
        other = copy(self)
        Resident.__init__(other, np.array(x, dtype=float), np.array(v, dtype=float), time)
        return other

    def _state_at(self, t: float | None, x: np.ndarray | None, v: np.ndarray | None) -> tuple[float, np.ndarray, np.ndarray]:
        """What of a state is not given is as it is now; in float64."""
        x, v = (np.asarray(now if some is None else some, float) for some, now in ((x, self.x), (v, self.v)))
        return self.time if t is None else t, x, v

    @property
    def forces(self) -> tuple[Force, ...]:
        return self._forces

    @forces.setter
    def forces(self, forces: Sequence[Force]) -> None:
        all_are(Force, "forces", forces, "Gravity(), Springs(…), OwnForce(function)")
        self._forces = tuple(force.bound(self.x, self.mass) for force in forces)
        self.chains = Chains.of(len(self.mass), self._forces)

    @property
    def colliders(self) -> tuple[Collider, ...]:
        return self._colliders

    @colliders.setter
    def colliders(self, colliders: Sequence[Collider]) -> None:
        all_are(Collider, "colliders", colliders, "Plane(…), Sphere(…)")
        self._colliders = tuple(colliders)

    @property
    def dimension(self) -> int:
        """Of its phase space: 6 n."""
        return 6 * len(self.x)

    @property
    def state(self) -> np.ndarray:
        """All positions, then all velocities, shape (6 n,)."""
        return np.concatenate([self.x.ravel(), self.v.ravel()])

    @state.setter
    def state(self, y: Any) -> None:
        self.x, self.v = (part.copy() for part in self._parts(numbers("state", y, (self.dimension,))))

    def force(self, t: float | None = None, x: np.ndarray | None = None, v: np.ndarray | None = None) -> np.ndarray:
        """What acts on each particle, now or in another state, shape (n, 3) [N]."""
        t, x, v = self._state_at(t, x, v)
        total = np.zeros((len(self.x), 3))
        for force in self.forces:
            total += force.force(t, x, v, self.mass)
        return total

    def acceleration(self, t: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """f/m, zero for what is pinned, shape (n, 3) [m/s²]; told by machine code if it can."""
        return acting(self).force(t, x, v) * self.inverse_mass[:, None]

    def product(self, t: float, x: np.ndarray, v: np.ndarray, p: np.ndarray, h: float) -> np.ndarray:
        """(h D + h² K) p of all forces, made positive semidefinite, shape (n, 3); see `Force.product`."""
        total = np.zeros((len(self.x), 3))
        for force in self.forces:
            total += force.product(t, x, v, self.mass, p, h, convex=True)
        return total

    def diagonal(self, t: float, x: np.ndarray, v: np.ndarray, h: float) -> np.ndarray:
        """The blocks on the diagonal of what `product` multiplies with, shape (n, 3, 3)."""
        total = np.zeros((len(self.x), 3, 3))
        for force in self.forces:
            total += force.diagonal(t, x, v, self.mass, h, convex=True)
        return total

    def derivative(self, t: float | None = None) -> np.ndarray:
        """Of the state: velocities, then f/m, shape (6 n,)."""
        return self.rhs(self.time if t is None else t, self.state)

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        """The derivative of any state, as `scipy.integrate.solve_ivp` wants it, shape (6 n,)."""
        x, v = self._parts(y)
        return np.concatenate([v.ravel(), self.acceleration(t, x, v).ravel()])

    def events(self) -> list[Callable[[float, np.ndarray], float]]:
        """For each collider an event that ends `solve_ivp`: some particle runs into it; see `bounced`."""
        return [self._event(collider) for collider in self.colliders]

    def bounced(self, t: float, y: np.ndarray) -> np.ndarray:
        """The state after particles that are at a collider, and heading in, bounced off: V′ = V_T − k_r V_N, shape (6 n,)."""
        x, v = (part.copy() for part in self._parts(np.asarray(y, dtype=float)))
        for collider in self.colliders:
            gap, n = collider.gap(t, vectors(x))
            normal = np.stack(np.broadcast_arrays(*n, gap), axis=1)[:, :3]
            relative = v - np.stack(np.broadcast_arrays(*collider.velocity(t, vectors(x)), gap), axis=1)[:, :3]
            incoming = (relative * normal).sum(axis=1)
            hit = (gap < 1e-6) & (incoming < 0.0) & (self.inverse_mass > 0.0)
            v[hit] -= (1.0 + collider.restitution) * incoming[hit, None] * normal[hit]
        return np.concatenate([x.ravel(), v.ravel()])

    def energy(self, t: float | None = None, x: np.ndarray | None = None, v: np.ndarray | None = None) -> float:
        """Kinetic energy, and potential energy of all forces that have one, now or in another state [J]."""
        t, x, v = self._state_at(t, x, v)
        potential = sum(force.energy(t, x, self.mass) for force in self.forces)
        return 0.5 * float(self.mass @ (v * v).sum(axis=1)) + potential

    def power(self, t: float, x: np.ndarray, v: np.ndarray) -> float:
        """Of all that has no energy of its own: drag, wind, damping [W]."""
        total = 0.0
        for force in self.forces:
            f = force.force(t, x, v, self.mass)
            if force.conservative:
                f = f - force.force(t, x, np.zeros_like(v), self.mass)
            total += float(np.vdot(f, v))
        return total

    def momentum(self) -> tuple[np.ndarray, np.ndarray]:
        """Linear, and angular about the origin [N s, N m s]."""
        _, x, v = self._state_at(None, None, None)
        p = self.mass[:, None] * v
        return p.sum(axis=0), np.cross(x, p).sum(axis=0)

    def step(
        self,
        h: float,
        solver: Solver = "semi_implicit",
        steps: int = 1,
        threads: int | None = None,
    ) -> float:
        """Go on by a step, or several.

        Args:
            h: its length [s].
            solver: the name of one of `SOLVERS`, or an `ImplicitEuler`, `Adaptive` or `XPBD`.
            steps: how many.
            threads: how many may share the work; None is as many as are useful.

        Returns:
            By how much the last turn of an implicit solver changed velocities, or, if it takes one turn only, what this left
            of its equation; by how much another pass of XPBD would change them: at most of all steps [m/s]. Zero of others.

        Raises:
            ValueError: the step has no length, there is no such solver, or the number of steps is none.
            FloatingPointError: numbers are no longer finite: the step is too long for what acts.
            ArithmeticError: an adaptive solver needs more steps than it may take, or shorter ones than there are.

        What raises leaves the system as it was when it was last looked at.
        """
        h, method = positive("h", h), method_of(solver)
        if not isinstance(steps, int) or steps < 0:
            raise ValueError(f"steps is {steps!r}; expected a whole number")
        before = self.seen()
        try:
            residual, flags = advance(self, h, method, steps, threads)
            if flags is None or flags:
                self._check_finite(h, solver, steps, before[2])
        except Exception:
            self.back_to(before)
            raise
        return residual

    def run(
        self,
        duration: float,
        dt: float,
        solver: Solver = "semi_implicit",
        fps: float = 60.0,
        threads: int | None = None,
        progress: bool = False,
    ) -> Cloud:
        """Go on for a time, and record frames, the state that there is first.

        Args:
            duration: [s]; the last frame is the last that it holds.
            dt: length of a step [s]; it is shortened so that frames fall on steps.
            solver, threads: as of `step`.
            fps: frames a second.
            progress: show a bar if it takes long.

        Raises:
            ValueError: a time is impossible, or there is no such solver.
        """
        from tqdm import tqdm

        duration, dt, fps = positive("duration", duration), positive("dt", dt), positive("fps", fps)
        frames = math.floor(duration * fps + 1e-9)
        if frames < 1:
            raise ValueError(f"duration {duration:g} s is shorter than one frame at {fps:g} fps; give more of either")
        steps, start = max(1, math.ceil(1.0 / (fps * dt) - 1e-9)), self.time
        x, v = np.empty((2, frames + 1, len(self.x), 3), self.dtype)
        energy = np.empty(frames + 1)
        bar = tqdm(range(frames + 1), unit="frame", delay=2.0, disable=None if progress else True, leave=False)
        for k in bar:
            if k > 0:
                self.step(1.0 / (fps * steps), solver, steps, threads)
                self.time = start + k / fps
            x[k], v[k], energy[k] = self.x, self.v, self.energy()
        return Cloud(start + np.arange(frames + 1) / fps, x, v, energy, segments(self.forces), triangles(self.forces))

    def _check_finite(self, h: float, solver: Any, steps: int, start: float) -> None:
        """That no numbers have overflowed since some time."""
        if np.isfinite(self.x).all() and np.isfinite(self.v).all():
            return
        lost = np.flatnonzero(~np.isfinite(np.hstack([self.x, self.v])).all(axis=1))
        raise FloatingPointError(
            f"{len(lost)} of {len(self.x)} particles, the first of them {lost[0]}, have no finite place or velocity after "
            f"{steps} steps of {h:g} s by {solver!r} from t = {start:g} s; the system is as it was then: "
            "take shorter steps, or solver='implicit_euler' if forces are stiff"
        )

    def arrive(self, h: float, x: np.ndarray, v: np.ndarray, lag: float) -> None:
        """Where a step would have led, unless something was in the way."""
        if self.colliders:
            old, new = (vectors(self.x), vectors(self.v)), (vectors(x), vectors(v))
            found = collided(self.colliders, self.time, h, *old, *new, free=self.inverse_mass > 0.0, lag=lag)
            x, v = (np.stack(list(new), axis=1) for new in found)
        self.x, self.v, self.time = x, v, self.time + h

    def _event(self, collider: Collider) -> Callable[[float, np.ndarray], float]:
        def event(t: float, y: np.ndarray) -> float:
            gap, _ = collider.gap(t, vectors(self._parts(y)[0]))
            return float(np.min(np.where(self.inverse_mass > 0.0, gap, np.inf)))

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return event

    def _parts(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n = len(self.x)
        return y[: 3 * n].reshape(n, 3), y[3 * n :].reshape(n, 3)
