"""A rig with what acts on it and a method to move it in time."""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import GRAVITY, Argument, check_threads, checked
from articulated.dynamics.functions import kinetic_energy, potential_energy
from articulated.rig import Rig
from articulated.simulation.control import Signal
from articulated.simulation.methods import INTEGRATORS, Times
from articulated.simulation.rollout import Plan, Rollout
from articulated.simulation.state import State
from articulated.trajectory import Outcome, Trajectory

_LARGEST = 1e15
"""A state with larger numbers than this has diverged: an angle has no sine any more that means anything."""

Control = ArrayLike | Callable[[float, State], ArrayLike | None] | None


@dataclass(frozen=True, eq=False)
class Simulation:
    """Moves a rig in time, under gravity, its joints' own damping and friction, a control and external wrenches.

    Attributes:
        rig: the rig.
        dt: length of a step [s]; `run` shortens it so that frames fall on steps. The first step that dopri5 tries.
        gravity: acceleration of free fall, in the world, shape (3,) [m/s²].
        integrator: "semi_implicit" (order 1, robust, damping implicit), "euler" (1), "midpoint" (2), "rk4" (4), or "dopri5" (5,
            adaptive: each state has its own steps).
        substeps: steps in a control period: the control is asked for, and then held, that often.
        rtol, atol: relative and absolute tolerance of a step of dopri5.
        max_steps: of dopri5, for each state.
        threads: how many threads share a batch; None is as many as there are cores.

    Raises:
        ValueError: a number is impossible or the integrator unknown.
    """

    rig: Rig
    dt: float = 0.002
    gravity: ArrayLike = GRAVITY
    integrator: str = "semi_implicit"
    substeps: int = 1
    rtol: float = 1e-6
    atol: float = 1e-9
    max_steps: int = 100_000
    threads: int | None = None
    _gravity: tuple[float, float, float] = field(init=False, repr=False)

    def __post_init__(self):
        if self.integrator not in INTEGRATORS:
            raise ValueError(f"integrator is {self.integrator!r}; expected one of {', '.join(INTEGRATORS)}")
        for name in ("dt", "rtol", "atol"):
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
        object.__setattr__(self, "_gravity", tuple(gravity.tolist()))

    def reset(self, q: ArrayLike | None = None, v: ArrayLike | None = None) -> State:
        """A state at time 0.

        Args:
            q: configurations, shape (..., nq); None is the neutral one.
            v: generalized velocities, shape (..., nv); None is rest.

        Raises:
            ValueError: an array does not fit the rig, is not finite, or a quaternion is not of unit length.
        """
        rig = self.rig
        q = checked(rig, Argument("q0", rig.neutral() if q is None else q, (rig.nq,), role="q"))
        v = checked(rig, Argument("v0", np.zeros(rig.nv) if v is None else v, (rig.nv,)))
        try:
            batch = np.broadcast_shapes(q.shape[:-1], v.shape[:-1])
        except ValueError:
            raise ValueError(f"leading axes do not broadcast: q0 {q.shape}, v0 {v.shape}") from None
        q = np.array(np.broadcast_to(q, (*batch, rig.nq)), dtype=float)
        v = np.array(np.broadcast_to(v, (*batch, rig.nv)), dtype=float)
        return State(0.0, q, v, np.zeros(batch))

    def step(self, state: State, control: Control = None, external: Control = None) -> State:
        """One control period, `substeps` steps of `dt`, on.

        Args:
            state: from `reset` or an earlier `step`.
            control: generalized forces, shape (..., nv) [N m, N], or a function of time and state that gives them, or None.
            external: likewise wrenches on links, (force, couple) in the world at the link origin, shape (..., nlinks, 6)
                [N, N m].

        Raises:
            ValueError: an array does not fit the rig, is not finite, or does not broadcast with the state.
        """
        rollout = self._rollout(state, control, external, 1, 1, self.dt * self.substeps)
        rollout.step()
        return replace(rollout.state(1), time=state.time + self.dt * self.substeps)

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
                state, called once a control period for the whole batch; or None.
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
        rollout = self._rollout(start, control, external, frames, periods, 1.0 / (fps * periods))
        q, v, tau = (np.empty((*batch, frames + 1, n)) for n in (self.rig.nq, self.rig.nv, self.rig.nv))
        work = np.empty((*batch, frames + 1))
        with _Bar(progress, frames + 1, self.rig.name) as advance_bar:
            for some in rollout.run():
                these = slice(some.first, some.first + some.q.shape[-2])
                q[..., these, :], v[..., these, :], tau[..., these, :] = some.q, some.v, some.tau
                work[..., these] = some.work
                advance_bar(some.q.shape[-2])
        return self._trajectory(q, v, tau, work, np.arange(frames + 1) / fps, rollout)

    def _rollout(self, start: State, control: Control, external: Control, frames: int, periods: int, period: float) -> Rollout:
        batch, total = start.work.shape, frames * periods
        signals = (
            Signal(self.rig, "control", (self.rig.nv,), batch, total, control),
            Signal(self.rig, "external", (self.rig.nlinks, 6), batch, total, external),
        )
        times = Times(period, frames * periods * period, period / self.substeps, self.rtol, self.atol, self.max_steps)
        plan = Plan(frames, periods, self.substeps, times)
        return Rollout(self.rig, self.integrator, self._gravity, start, *signals, plan, self.threads)

    def _trajectory(
        self, q: np.ndarray, v: np.ndarray, tau: np.ndarray, work: np.ndarray, time: np.ndarray, rollout: Rollout
    ) -> Trajectory:
        # a state that overflowed, or whose energy would, has none; this is said once, below
        with np.errstate(invalid="ignore"):
            finite = np.asarray((np.abs(q) < _LARGEST).all(axis=-1) & (np.abs(v) < _LARGEST).all(axis=-1))
        sound_q = np.where(finite[..., None], q, self.rig.neutral())
        sound_v = np.where(finite[..., None], v, 0.0)
        kinetic = np.where(finite, kinetic_energy(self.rig, sound_q, sound_v), np.nan)
        potential = np.where(finite, potential_energy(self.rig, sound_q, self.gravity), np.nan)
        outcome = np.where(finite.all(axis=-1), np.int8(Outcome.COMPLETED), np.int8(Outcome.DIVERGED))
        if (reached := rollout.reached()) is not None:
            t, failed = reached
            stopped = np.where(failed, np.int8(Outcome.STEP_TOO_SMALL), np.int8(Outcome.STEP_LIMIT))
            outcome = np.where(t >= rollout.plan.times.end, outcome, stopped)
        settings = {"integrator": self.integrator, "dt": rollout.plan.times.h, "substeps": self.substeps}
        if self.integrator == "dopri5":
            settings |= {"rtol": self.rtol, "atol": self.atol}
        trajectory = Trajectory(
            rig=self.rig,
            time=time,
            q=q,
            v=v,
            tau=tau,
            kinetic_energy=kinetic,
            potential_energy=potential,
            work=work,
            outcome=np.asarray(outcome),
            settings=settings,
        )
        for outcome, count in trajectory.report.outcomes.items():
            if outcome is not Outcome.COMPLETED:
                text = (
                    f"{count} of {trajectory.outcome.size} states of rig {self.rig.name!r}: {outcome.label}; {outcome.remedy}"
                )
                warnings.warn(text, RuntimeWarning, stacklevel=3)
        return trajectory


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
