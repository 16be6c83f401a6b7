"""The time loop on numpy: keeps a state as scalars and moves it period by period with one of the integrators."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import numpy as np

from articulated.compiler import as_scalars
from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar
from articulated.simulation import dopri5
from articulated.simulation.forces import Forces
from articulated.simulation.runge_kutta import EULER, MIDPOINT, RK4, Point, runge_kutta_step
from articulated.simulation.semi_implicit import semi_implicit_step
from articulated.simulation.state import State
from articulated.trajectory import Outcome

Step = Callable[[Mechanism, Point, Forces, Scalar], Point]


class Stepper(Protocol):
    """A state under way."""

    def advance(self, forces: Forces, substeps: int, t_end: float, t_stop: float) -> None:
        """Move through one control period, which ends at `t_end`; the forces stay the same until `t_stop`."""
        ...

    def state(self, time: float, t: float) -> State:
        """The state at t, the end of the last period; `time` is what to call it."""
        ...

    def outcomes(self) -> np.ndarray:
        """How each state fared so far, of `Outcome`, shape of the batch."""
        ...


class FixedStepper:
    """Steps of one length."""

    def __init__(self, step: Step, mechanism: Mechanism, state: State, h: float, *_: Any):
        self.step, self.mechanism, self.h = step, mechanism, h
        self.batch = state.work.shape
        self.point = _point(state)

    def advance(self, forces: Forces, substeps: int, t_end: float, t_stop: float) -> None:
        with np.errstate(all="ignore"):
            for _ in range(substeps):
                self.point = self.step(self.mechanism, self.point, forces, self.h)

    def state(self, time: float, t: float) -> State:
        return _state(self.point, time, self.batch)

    def outcomes(self) -> np.ndarray:
        return np.full(self.batch, Outcome.COMPLETED, dtype=np.int8)


class AdaptiveStepper:
    """Steps of dopri5, each state its own; where the forces stay the same, steps cross frames, which are interpolated."""

    def __init__(self, mechanism: Mechanism, state: State, h: float, rtol: float, atol: float, max_steps: int):
        self.mechanism, self.h, self.rtol, self.atol, self.max_steps = mechanism, h, rtol, atol, max_steps
        self.batch = state.work.shape
        self.start = _point(state)
        self.forces: Forces | None = None
        self.motion: dopri5.Adaptive | None = None
        self.t_end = 0.0

    def advance(self, forces: Forces, substeps: int, t_end: float, t_stop: float) -> None:
        self.t_end = t_end
        with np.errstate(all="ignore"):
            if self.motion is None:
                self.motion = dopri5.begin(self.mechanism, self.start, forces, self.h)
            elif forces is not self.forces:
                self.motion = dopri5.restarted(self.mechanism, self.motion, forces)
            self.forces = forces
            while np.any(dopri5.under_way(self.motion, t_end, self.max_steps)):
                self.motion = dopri5.attempt(
                    self.mechanism, self.motion, forces, t_end, t_stop, self.rtol, self.atol, self.max_steps
                )

    def state(self, time: float, t: float) -> State:
        assert self.motion is not None
        with np.errstate(all="ignore"):
            point = dopri5.interpolated(self.mechanism, self.motion, t)
        state = _state(point, time, self.batch)
        missing = np.broadcast_to(self.motion.t, self.batch) < t
        state.q[missing] = state.v[missing] = state.work[missing] = np.nan
        return state

    def outcomes(self) -> np.ndarray:
        assert self.motion is not None
        arrived = np.broadcast_to(self.motion.t, self.batch) >= self.t_end
        failed = np.broadcast_to(self.motion.failed, self.batch) > 0.5
        result = np.where(failed, int(Outcome.STEP_TOO_SMALL), int(Outcome.STEP_LIMIT))
        return np.where(arrived, int(Outcome.COMPLETED), result).astype(np.int8)


INTEGRATORS: dict[str, Callable[..., Stepper]] = {
    "semi_implicit": partial(FixedStepper, semi_implicit_step),
    "euler": partial(FixedStepper, lambda m, point, forces, h: runge_kutta_step(m, EULER, point, forces, h)),
    "midpoint": partial(FixedStepper, lambda m, point, forces, h: runge_kutta_step(m, MIDPOINT, point, forces, h)),
    "rk4": partial(FixedStepper, lambda m, point, forces, h: runge_kutta_step(m, RK4, point, forces, h)),
    "dopri5": AdaptiveStepper,
}
"""How to make a stepper of each integrator: from a mechanism, a state, h, rtol, atol and max_steps."""


def _point(state: State) -> Point:
    return Point(as_scalars(state.q, 1), as_scalars(state.v, 1), as_scalars(state.work, 0))


def _state(point: Point, time: float, batch: tuple[int, ...]) -> State:
    q, v, work = np.empty((*batch, len(point.q))), np.empty((*batch, len(point.v))), np.empty(batch)
    for k, x in enumerate(point.q):
        q[..., k] = x
    for k, x in enumerate(point.v):
        v[..., k] = x
    work[...] = point.work
    return State(time, q, v, work)
