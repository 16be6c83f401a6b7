"""A rig with what acts on it and a method to move it in time."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import GRAVITY, Argument, check_threads, checked
from articulated.dynamics.loops.assembly import assemble
from articulated.dynamics.loops.functions import closed, gaps
from articulated.particles.attached import Attached
from articulated.rig import Loop, Rig
from articulated.scalar import flatten
from articulated.simulation.actuation import PD, Gains, Stops, gains
from articulated.simulation.command import Command, split
from articulated.simulation.contact.candidates import ContactPoint
from articulated.simulation.contact.collisions import Collisions
from articulated.simulation.contact.ground import Ground
from articulated.simulation.contact.sensing import Contacts, contact_geometry, contact_links, contact_others
from articulated.simulation.control import Signal
from articulated.simulation.describe import described
from articulated.simulation.freight import Freight
from articulated.simulation.implicit.towing import size
from articulated.simulation.methods import INTEGRATORS, Times
from articulated.simulation.recording import trajectory_of
from articulated.simulation.rollout import Plan, Rollout, Signals, World
from articulated.simulation.state import State
from articulated.trajectory import Trajectory

_OPEN = 1e-3
"""A loop may be so far open at the start [m, rad]: digits that were cut. It is closed then."""

_TOO_LONG = 0.05
"""A rope may be so much too long [m]: it gives way under a load."""

Control = ArrayLike | Command | Callable[[float, State], ArrayLike | Command | None] | None


@dataclass(frozen=True, eq=False)
class Simulation:
    """Moves a rig in time: gravity, ground, joint limits, drives, the joints' own damping and friction, control and wrenches.

    The integrator "semi_implicit" solves for all that is stiff or one-sided in each step: any stiffness, gain or damping is
    stable at any dt, resting things rest, and impacts take no time. It is of order 1, and takes energy from what turns fast,
    dt ω² a second. The others have order, and see ground, limits and drives as smooth forces: for free flight, gentle contact
    and gradients, with a dt that resolves the stiffness given.

    Attributes:
        rig: the rig.
        dt: length of a step [s]; `run` shortens it so that frames fall on steps. The first step that dopri5 tries.
        gravity: acceleration of free fall, in the world, shape (3,) [m/s²].
        ground: what it may touch; True is the plane z = 0, None or False is nothing.
        contact_points: what of the rig may touch the ground: points, and names of links, with all their collision shapes.
            None takes all links that move. What a step takes grows with their number.
        limits: whether joint limits are stops, or what stops they are.
        actuation: drives of its joints; then a control is the configuration that they hold to.
        particles: what the rig carries: hair, capes, ropes; see `articulated.particles.Attached`. It takes the implicit step.
        collisions: which bodies touch each other, and what stands around; True is all that can meet, None or False nothing.
        loops: what closes the rig besides its joints; None for what it came with. A rope makes the rig one with stops.
        integrator: "semi_implicit" (order 1, all that is stiff implicit), "euler" (1), "midpoint" (2), "rk4" (4), or "dopri5"
            (5, adaptive: each state has its own steps). None takes rk4 for a rig that swings freely, and semi_implicit for one
            with ground, limits, drives, damping or friction.
        substeps: steps in a control period: the control is asked for, and then held, that often.
        tolerance: of the implicit step's solver: residual of the velocities, root mean square over the rig's mass [m/s].
        rtol, atol: relative and absolute tolerance of a step of dopri5.
        max_steps: of dopri5, for each state.
        threads: how many threads share a batch; None is as many as there are cores.

    Raises:
        ValueError: a number is impossible, the integrator or a link unknown, or drives do not fit the rig.
    """

    rig: Rig
    dt: float = 0.002
    gravity: ArrayLike = GRAVITY
    ground: Ground | bool | None = None
    contact_points: Sequence[ContactPoint | str] | None = None
    limits: Stops | bool = True
    actuation: PD | None = None
    loops: Sequence[Loop] | None = None
    particles: Sequence[Attached] | Attached = ()
    collisions: Collisions | bool | None = None
    integrator: str | None = None
    substeps: int = 1
    tolerance: float = 1e-4
    rtol: float = 1e-6
    atol: float = 1e-9
    max_steps: int = 100_000
    threads: int | None = None
    _world: World = field(init=False, repr=False)
    _gains: Gains | None = field(init=False, repr=False)

    def __post_init__(self):
        if self.integrator is not None and self.integrator not in INTEGRATORS:
            raise ValueError(f"integrator is {self.integrator!r}; expected one of {', '.join(INTEGRATORS)}")
        for name in ("dt", "tolerance", "rtol", "atol"):
            value = getattr(self, name)
            if not isinstance(value, (int, float, np.floating)) or not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value!r}; expected a positive number")
        for name in ("substeps", "max_steps"):
            try:
                fine = operator.index(getattr(self, name)) >= 1
            except TypeError:
                fine = False
            if not fine:
                raise ValueError(f"{name} is {getattr(self, name)!r}; expected a positive integer")
        gravity = checked(self.rig, Argument("gravity", self.gravity, (3,)))
        if gravity.shape != (3,):
            raise ValueError(f"gravity has shape {gravity.shape}; expected (3,)")
        check_threads(self.threads)
        scene, like, numbers = described(
            self.rig,
            self.ground,
            self.contact_points,
            self.limits,
            self.actuation,
            self.tolerance,
            self.loops,
            self.collisions,
        )
        freight = self._freight(gravity.tolist())
        if freight is not None:
            scene = replace(scene, carriers=freight.carriers)
            if self.integrator not in (None, "semi_implicit"):
                raise ValueError(f"integrator is {self.integrator!r}; with particles attached, expected semi_implicit")
        method = self.integrator or ("semi_implicit" if scene.is_stiff else "rk4")
        object.__setattr__(self, "integrator", method)
        object.__setattr__(self, "_gains", gains(self.rig, self.actuation) if self.actuation is not None else None)
        object.__setattr__(self, "_world", World(scene, method, like, numbers, tuple(gravity.tolist()), freight))

    def _freight(self, gravity: list[float]) -> Freight | None:
        some = (self.particles,) if isinstance(self.particles, Attached) else tuple(self.particles)
        for one in some:
            if not isinstance(one, Attached):
                raise ValueError(f"particles holds {one!r}; expected particles.Attached(…), as hair_on(…) makes them")
        ground = Ground() if self.ground is True else self.ground or None
        return Freight.of(self.rig, some, gravity, ground) if some else None

    def reset(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        state: State | None = None,
        where: ArrayLike | None = None,
    ) -> State:
        """A state at time 0; or of a batch under way, with some of its states begun anew.

            state = simulation.reset(q0, v0, state, where=fallen)

        Args:
            q: configurations, shape (..., nq), with loops closed to a millimetre; None is the neutral one, or the nearest
                that is closed. float32, with v, makes all that follows float32.
            v: generalized velocities, shape (..., nv); None is rest. Of these, what would open loops is left out.
            state: the batch under way.
            where: which of its states begin anew, booleans of its leading shape.

        Raises:
            ValueError: an array does not fit the rig, is not finite, a quaternion is not of unit length, or loops are open.
        """
        rig = self.rig
        if q is None:
            q = assemble(rig, self.loops) if self._world.scene.rows else rig.neutral()
        q = checked(rig, Argument("q0", q, (rig.nq,), role="q"))
        v = checked(rig, Argument("v0", np.zeros(rig.nv) if v is None else v, (rig.nv,)))
        try:
            batch = np.broadcast_shapes(q.shape[:-1], v.shape[:-1])
        except ValueError:
            raise ValueError(f"leading axes do not broadcast: q0 {q.shape}, v0 {v.shape}") from None
        dtype = np.float32 if q.dtype == v.dtype == np.float32 else np.float64
        q, v = self._closed(q, v)
        remembered = INTEGRATORS[self._world.integrator].remembers(self._world.scene)
        new = State.of(0.0, np.zeros((*batch, rig.nq + rig.nv + 1 + remembered), dtype), rig.nq, rig.nv)
        new.q[...], new.v[...] = q, v
        if self._world.freight is not None:
            new = replace(new, particles=self._world.freight.placed(new.q.astype(float), new.v.astype(float)))
        return new if state is None else _partly(new, state, where)

    def _closed(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The closed states nearest to some."""
        scene, rig = self._world.scene, self.rig
        if not scene.rows:
            return q, v
        gap, ropes = gaps(rig, (*scene.loops, *scene.ropes), q, self.threads), len(scene.ropes)
        axes, some = tuple(range(q.ndim - 1)), gap.shape[-1] - ropes
        gap = np.concatenate([np.abs(gap[..., :some]), gap[..., some:]], axis=-1).max(initial=0.0, axis=axes)
        is_open = gap > np.repeat([_OPEN, _TOO_LONG], [some, ropes])
        if is_open.any():
            worst = int(np.argmax(np.where(is_open, gap, 0.0)))
            raise ValueError(
                f"q0 leaves {int(is_open.sum())} rows of loops open, {scene.rows[worst]} by {gap[worst]:.3g} m or rad;"
                " give it a closed configuration: art.assemble(rig, loops, q_guess) finds one"
            )
        if not scene.loops:
            return q, v
        same = closed(rig, scene.loops, q, v, self.threads)
        return same[..., : rig.nq], same[..., rig.nq :]

    def step(self, state: State, control: Control = None, external: Control = None) -> State:
        """One control period, `substeps` steps of `dt`, on.

        Args:
            state: from `reset` or an earlier `step`.
            control: generalized forces, shape (..., nv) [N m, N], or a function of time and state that gives them, or None;
                with drives the configuration that they are to hold, (..., nq), or a `Command`, or a function that gives these.
            external: likewise wrenches on links, (force, couple) in the world at the link origin, shape (..., nlinks, 6)
                [N, N m].

        Raises:
            ValueError: an array does not fit the rig, is not finite, or does not broadcast with the state.
        """
        if control is None and self._world.scene.drives is not None:
            raise ValueError("control is None; with actuation, give the configuration that the drives are to hold, (..., nq)")
        rollout = self._rollout(state, control, external, 1, 1, self.dt * self.substeps)
        rollout.step()
        return rollout.state(1)

    def run(
        self,
        q0: ArrayLike | None = None,
        v0: ArrayLike | None = None,
        duration: float = 5.0,
        fps: float = 60.0,
        control: Control = None,
        external: Control = None,
        progress: bool = False,
    ) -> Trajectory:
        """Run for a time and record frames.

        Control and external wrenches are held over a control period. Frames fall on control periods: steps are taken a little
        shorter than `dt` if need be.

        Args:
            q0, v0: the start, as in `reset`; leading axes are a batch.
            duration: [s]; the last frame is the last that it holds.
            fps: frames a second.
            control: generalized forces [N m, N]: an array, shape (..., nv) with no more axes than q0, held throughout; or
                with one axis more, shape (..., N, nv), whose N rows share the duration evenly; or a function of time and
                state, called once a control period for the whole batch; or None. With drives likewise the configuration that
                they are to hold, (..., nq), or a `Command`; None is that of the start.
            external: likewise wrenches on links, (force, couple) in the world at the link origin, shape (..., nlinks, 6)
                or (..., N, nlinks, 6) [N, N m].
            progress: show a bar if it takes long.

        Returns:
            The trajectory; its `report` tells how well it went, its `outcome` how each state ended.

        Raises:
            ValueError: an array does not fit the rig, is not finite or does not broadcast; a quaternion is not of unit
                length; a time is impossible.
        """
        frames = _frame_count(duration, fps)
        start = self.reset(q0, v0)
        batch = start.q.shape[:-1]
        periods = max(1, math.ceil(1.0 / (fps * self.dt * self.substeps) - 1e-9))  # control periods a frame
        if control is None and self._world.scene.drives is not None:
            control = start.q
        rollout = self._rollout(start, control, external, frames, periods, 1.0 / (fps * periods))
        arrays = [np.empty((*batch, frames + 1, *shape), start.q.dtype) for shape in rollout.recorded]
        tau = np.empty((*batch, frames + 1, self.rig.nv))
        particles = None if start.particles is None else np.empty((*batch, frames + 1, *start.particles.shape[-2:]))
        with _Bar(progress, frames + 1, self.rig.name) as advance_bar:
            for some in rollout.run():
                these = slice(some.first, some.first + some.tau.shape[-2])
                core = (Ellipsis, these)
                for array, part, shape in zip(arrays, some.recorded, rollout.recorded, strict=True):
                    array[(*core, *[slice(None)] * len(shape))] = part
                tau[..., these, :] = some.tau
                if particles is not None:
                    particles[..., these, :, :] = some.particles
                advance_bar(some.tau.shape[-2])
        return trajectory_of(rollout, arrays, tau, fps, particles)

    def contacts(self, state: State) -> Contacts:
        """Where a state's points of contact are, and how they were pushed in the last step: what sensors feel."""
        scene, batch = self._world.scene, state.work.shape
        geometry = contact_geometry(scene, state.q)
        shapes = ("contact_forces", scene.touches), ("pair_forces", len(scene.pairs))
        forces = np.concatenate([self._shown(state, name, 3 * n).reshape(*batch, n, 3) for name, n in shapes], axis=-2)
        links, others = contact_links(scene), contact_others(scene)
        return Contacts(links, others, geometry[..., :3], geometry[..., 3:6], geometry[..., 6], forces)

    def loop_forces(self, state: State) -> np.ndarray:
        """How loops pulled in the last step, a row each, ropes' last, shape (..., m) [N, N m]; see `Loop.rows`."""
        return self._shown(state, "loop_forces", len(self._world.scene.rows))

    def _shown(self, state: State, name: str, size: int) -> np.ndarray:
        """So many numbers that a method shows of the last step, shape (..., size); zeros if it does not."""
        shown = INTEGRATORS[self._world.integrator].shown(self._world.layout)
        part = np.array(flatten(shown.get(name, [])), dtype=int) - (self.rig.nq + self.rig.nv + 1)
        return state.memory[..., part] if len(part) else np.zeros((*state.work.shape, size))

    def residual(self, state: State) -> np.ndarray:
        """The largest that the solver has left in any step so far, shape (...) [m/s]; zeros for methods that do not solve."""
        stance = getattr(self._world.layout, "stance", None)
        if stance is None:
            return np.zeros(state.work.shape)
        return state.memory[..., stance.residual - (self.rig.nq + self.rig.nv + 1)].copy()

    def _rollout(self, start: State, control: Control, external: Control, frames: int, periods: int, period: float) -> Rollout:
        batch, total, rig = start.work.shape, frames * periods, self.rig
        target, tau, numbers = (None, control, None) if self._gains is None else split(control, self._gains, rig)
        signals = Signals(
            Signal(rig, "control", (rig.nv,), batch, total, tau, start.q.dtype),
            Signal(rig, "control", (rig.nq,), batch, total, target, start.q.dtype),
            Signal(rig, "external", (rig.nlinks, 6), batch, total, external, start.q.dtype),
            Signal(rig, "towed", (size(self._world.scene.carriers),), batch, total, None, start.q.dtype),
        )
        times = Times(period, frames * periods * period, period / self.substeps, self.rtol, self.atol, self.max_steps)
        plan = Plan(frames, periods, self.substeps, times)
        changing = None
        if numbers is not None and self._gains is not None:
            count = sum(part.shape[-1] for part in (self._gains.stiffness, self._gains.damping, self._gains.limit))
            changing = Signal(rig, "gains", (count,), batch, total, numbers, start.q.dtype)
        return Rollout(self._world, start, signals, plan, self.threads, changing)


def _partly(new: State, state: State, where: ArrayLike | None) -> State:
    """States of one batch where a mask holds, of another elsewhere."""
    mask, batch = np.asarray(where), state.work.shape
    if mask.dtype != bool or mask.shape != batch:
        raise ValueError(
            f"where holds {mask.dtype}, shape {mask.shape}; expected booleans, shape {batch}, as the state's batch"
        )
    now = state.motion()
    try:
        motion = np.where(mask[..., None], new.motion(), now)
    except ValueError:
        raise ValueError(f"q0 {new.q.shape} and v0 {new.v.shape} do not broadcast to the state's {batch}") from None
    result = State.of(state.time, motion.astype(now.dtype, copy=False), state.q.shape[-1], state.v.shape[-1])
    if state.particles is None or new.particles is None:
        return result
    return replace(result, particles=np.where(mask[..., None, None], new.particles, state.particles))


def simulate(rig: Rig, duration: float = 5.0, *, q0=None, v0=None, fps: float = 60.0, control=None, **settings) -> Trajectory:
    """Run a rig for a time: the short way to `Simulation(rig, **settings).run(q0, v0, duration, fps, control)`.

    Raises:
        ValueError: as these two do.
    """
    return Simulation(rig, **settings).run(q0, v0, duration, fps, control)


def _frame_count(duration: float, fps: float) -> int:
    for name, value in (("duration", duration), ("fps", fps)):
        if not isinstance(value, (int, float, np.number)) or not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value!r}; expected a positive number")
    frames = math.floor(duration * fps + 1e-9)
    if frames < 1:
        raise ValueError(f"duration {duration:g} s is shorter than one frame at {fps:g} fps; give more of either")
    return frames


class _Bar:
    """A progress bar that appears after two seconds, on a terminal only."""

    def __init__(self, wanted: bool, total: int, name: str):
        self.bar = None
        if wanted:
            from tqdm import tqdm

            self.bar = tqdm(total=total, desc=name, unit="frame", delay=2.0, disable=None, leave=False)

    def __enter__(self) -> Callable[[int], None]:
        return self._advance

    def _advance(self, count: int) -> None:
        if self.bar is not None:
            self.bar.update(count)

    def __exit__(self, *_) -> None:
        if self.bar is not None:
            self.bar.close()
