"""A rig with what acts on it and a method to move it in time."""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import GRAVITY, Argument, check_threads, checked
from articulated.dynamics.functions import kinetic_energy, potential_energy
from articulated.dynamics.mechanism import Mechanism, mechanism
from articulated.rig import Rig
from articulated.simulation.control import Schedule
from articulated.simulation.state import State
from articulated.simulation.steppers import INTEGRATORS, Stepper
from articulated.trajectory import Outcome, Trajectory

_LARGEST = 1e100
"""A state with larger numbers than this has diverged."""

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
    _mechanism: Mechanism = field(init=False, repr=False)

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
        object.__setattr__(self, "_mechanism", mechanism(self.rig))

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

    def step(self, state: State, control: ArrayLike | None = None, external: ArrayLike | None = None) -> State:
        """One control period, `substeps` steps of `dt`, on.

        Args:
            state: from `reset` or an earlier `step`.
            control: generalized forces, shape (..., nv) [N m, N]; None is none.
            external: wrenches on links, (force, couple) in the world at the link origin, shape (..., nlinks, 6) [N, N m].

        Raises:
            ValueError: an array does not fit the rig, is not finite, or does not broadcast with the state.
        """
        period = self.dt * self.substeps
        schedule = Schedule(self.rig, state.q.shape[:-1], period, 1, control, external, self._gravity)
        stepper = self._stepper(state, self.dt)
        stepper.advance(schedule.forces(0, state), self.substeps, period, period)
        return stepper.state(state.time + period, period)

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
        period = 1.0 / (fps * periods)
        schedule = Schedule(self.rig, batch, period, frames * periods, control, external, self._gravity)
        stepper = self._stepper(start, period / self.substeps)
        record = _Record(self.rig, batch, frames)
        state = start
        with _Bar(progress, frames, self.rig.name) as advance_bar:
            for frame in range(frames):
                for k in range(frame * periods, (frame + 1) * periods):
                    forces = schedule.forces(k, state)
                    if k == frame * periods:
                        record.put(frame, state, schedule.tau)
                    t_end = (k + 1) * period
                    t_stop = t_end if schedule.changes else frames * periods * period
                    stepper.advance(forces, self.substeps, t_end, t_stop)
                    if schedule.asks or k + 1 == (frame + 1) * periods:
                        state = stepper.state(t_end, t_end)
                advance_bar()
            record.put(frames, state, schedule.tau)
        return self._trajectory(record, np.arange(frames + 1) / fps, stepper, period / self.substeps)

    def _stepper(self, state: State, h: float) -> Stepper:
        make = INTEGRATORS[self.integrator]
        return make(self._mechanism, state, h, self.rtol, self.atol, self.max_steps)

    def _trajectory(self, record: _Record, time: np.ndarray, stepper: Stepper, h: float) -> Trajectory:
        # a state that overflowed, or whose energy would, has none; this is said once, below
        with np.errstate(invalid="ignore"):
            finite = (np.abs(record.q) < _LARGEST).all(axis=-1) & (np.abs(record.v) < _LARGEST).all(axis=-1)
        finite = np.asarray(finite)
        q = np.where(finite[..., None], record.q, self.rig.neutral())
        v = np.where(finite[..., None], record.v, 0.0)
        kinetic = np.where(finite, kinetic_energy(self.rig, q, v), np.nan)
        potential = np.where(finite, potential_energy(self.rig, q, self.gravity), np.nan)
        outcome = stepper.outcomes()
        outcome = np.where((outcome == Outcome.COMPLETED) & ~finite.all(axis=-1), np.int8(Outcome.DIVERGED), outcome)
        settings = {"integrator": self.integrator, "dt": h, "substeps": self.substeps}
        if self.integrator == "dopri5":
            settings |= {"rtol": self.rtol, "atol": self.atol}
        trajectory = Trajectory(
            rig=self.rig,
            time=time,
            q=record.q,
            v=record.v,
            tau=record.tau,
            kinetic_energy=kinetic,
            potential_energy=potential,
            work=record.work,
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


class _Record:
    def __init__(self, rig: Rig, batch: tuple[int, ...], frames: int):
        self.q = np.empty((*batch, frames + 1, rig.nq))
        self.v, self.tau = (np.zeros((*batch, frames + 1, rig.nv)) for _ in range(2))
        self.work = np.zeros((*batch, frames + 1))

    def put(self, frame: int, state: State, tau: np.ndarray) -> None:
        self.q[..., frame, :], self.v[..., frame, :] = state.q, state.v
        self.tau[..., frame, :], self.work[..., frame] = tau, state.work


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

    def __enter__(self) -> Callable[[], None]:
        return self._advance

    def _advance(self) -> None:
        if self.bar is not None:
            self.bar.update()

    def __exit__(self, *_) -> None:
        if self.bar is not None:
            self.bar.close()
