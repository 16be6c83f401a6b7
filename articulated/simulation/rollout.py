"""The time loop: control periods one after the other, with a record at the start of each frame.

Compiled, frames, periods and steps are loops of one kernel, which keeps a block of states in its own scratch from the first
frame to the last. Interpreted, or with a control that has to be asked for, periods are turns of a loop in Python.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from articulated.compiler import (
    Array,
    Kernel,
    Program,
    Rows,
    Tape,
    compiled,
    evaluate,
    interpreting,
    kernels_of,
)
from articulated.dynamics.boundary import GRAVITY, Argument
from articulated.dynamics.calls import call, states
from articulated.dynamics.mechanism import Mechanism, content, mechanism
from articulated.rig import Rig
from articulated.scalar import Nested, Scalar, flatten, rebuilt, repeat
from articulated.simulation.control import Signal
from articulated.simulation.forces import Forces
from articulated.simulation.methods import INTEGRATORS, Clock, Motion, Times
from articulated.simulation.runge_kutta import Point
from articulated.simulation.state import State

_FRAMES, _PERIODS, _SUBSTEPS = range(3)
_PATIENCE = 0.2
"""How long compiled code may run before it comes back, for an interrupt or to show progress [s]."""


@dataclass(frozen=True)
class Plan:
    """How a run is divided.

    Attributes:
        frames: how many.
        periods: control periods in a frame.
        substeps: steps in a period, of a method with steps of one length.
        times: lengths of all these, and how well an adaptive method is to do.
    """

    frames: int
    periods: int
    substeps: int
    times: Times


class Frames(NamedTuple):
    """Frames of a run: the number of the first, and arrays of shape (*batch, how many, …)."""

    first: int
    q: np.ndarray
    v: np.ndarray
    work: np.ndarray
    tau: np.ndarray


class Rollout:
    """A batch under way.

    Attributes:
        motion: what the method carries of each state, shape (*batch, size).
    """

    def __init__(
        self,
        rig: Rig,
        integrator: str,
        gravity: tuple[float, ...],
        start: State,
        tau: Signal,
        external: Signal,
        plan: Plan,
        threads: int | None,
    ):
        self.rig, self.gravity, self.tau, self.external, self.plan, self.threads = rig, gravity, tau, external, plan, threads
        self.integrator, self.method = integrator, INTEGRATORS[integrator]
        self.batch = start.work.shape
        self.changes = tau.changes or external.changes
        self.asks = tau.function is not None or external.function is not None
        self._like: Motion = self.method.begin(_point(rig, [0.0] * (rig.nq + rig.nv + 1)), 0.0)
        point = np.concatenate([start.q, start.v, start.work[..., None]], axis=-1)
        self.motion = point if isinstance(self._like, Point) else self._begun(point)

    def run(self) -> Iterator[Frames]:
        """All frames, some at a time."""
        plan = self.plan
        last = plan.frames * plan.periods
        if interpreting() or self.asks:
            yield from self._period_by_period()
        elif math.prod(self.batch):
            yield from self._many_at_once()
        yield self._now(plan.frames, self.state(last), self.tau.value if self.asks else self.tau.rows(np.array([last - 1])))

    def step(self) -> None:
        """One control period."""
        if interpreting() or self.asks:
            for signal in self._signals:
                signal.update(0, 0.0, self.state(0))
        self._period(0)

    def state(self, k: int) -> State:
        """Where the batch is at the start of period k."""
        t, point = k * self.plan.times.period, self.motion
        nq, nv = self.rig.nq, self.rig.nv
        if not isinstance(self._like, Point):
            given = [Argument("motion", point, point.shape[-1:]), Argument("t", t, ())]
            options = {"watched": False, "integrator": self.integrator}
            point = call(self.rig, _interpolated, given, (nq + nv + 1,), None, self.threads, **options)
        return State(t, point[..., :nq].copy(), point[..., nq : nq + nv].copy(), point[..., nq + nv].copy())

    def _begun(self, point: np.ndarray) -> np.ndarray:
        motion = np.empty((*self.batch, len(flatten(self._like))))
        given = [(point, 1), (np.broadcast_to(self.plan.times.h, self.batch), 0)]
        evaluate(lambda x, h: flatten(self.method.begin(_point(self.rig, x), h)), given, motion, self.batch)
        return motion

    def reached(self) -> tuple[np.ndarray, np.ndarray] | None:
        """How far each state got [s], and whether its step became too short; None if no step can fail."""
        motion = rebuilt(self._like, iter(np.moveaxis(self.motion, -1, 0)))
        reached = self.method.reached(motion)
        return (reached[0], reached[1] > 0.5) if reached else None

    def _period_by_period(self) -> Iterator[Frames]:
        for frame in range(self.plan.frames):
            for j in range(self.plan.periods):
                k = frame * self.plan.periods + j
                if j == 0 or self.asks:
                    state = self.state(k)
                for signal in self._signals:
                    signal.update(k, k * self.plan.times.period, state)
                if j == 0:
                    yield self._now(frame, state, self.tau.value)
                self._period(k)

    def _period(self, k: int) -> None:
        if math.prod(self.batch) == 0:
            return
        if not interpreting():
            self._run(k, 1, 1, [np.empty((*self.batch, 1, *shape)) for shape in self._recorded])
            return
        settings = self._settings(k)
        given = [(self.motion, 1), (np.broadcast_to(settings, (*self.batch, *settings.shape)), 1)]
        given += [(signal.value, len(signal.shape)) for signal in self._signals]
        m, resume = mechanism(self.rig), k == 0 or self.changes

        def algorithm(motion, settings, tau, external):
            forces = _forces(m, tau, external, self.gravity)
            motion = rebuilt(self._like, iter(motion))
            motion = self.method.resumed(m, motion, forces) if resume else motion
            clock = _clock(Times(*settings[1:]), settings[0], self.changes, self.plan.substeps)
            return flatten(self.method.advance(m, motion, forces, clock))

        moved = np.empty_like(self.motion)
        evaluate(algorithm, given, moved, self.batch)
        self.motion = moved

    def _many_at_once(self) -> Iterator[Frames]:
        plan, frames = self.plan, self.plan.frames
        work = self._kernel().cost(math.prod(self.batch)) * plan.periods * plan.substeps  # for a frame
        share = max(1, min(frames, int(_PATIENCE / max(work, 1e-9))))
        for first in range(0, frames, share):
            count = min(share, frames - first)
            arrays = [np.empty((*self.batch, count, *shape)) for shape in self._recorded]
            self._run(first * plan.periods, count, plan.periods, arrays)
            tau = self.tau.rows(np.arange(first, first + count) * plan.periods)
            q, v, work = arrays
            yield Frames(first, q, v, work, tau)

    def _now(self, frame: int, state: State, tau: np.ndarray | None) -> Frames:
        if tau is None:
            tau = np.zeros((*self.batch, 1, self.rig.nv))
        elif tau.ndim == len(self.batch) + 1:
            tau = tau[..., None, :]
        return Frames(frame, state.q[..., None, :], state.v[..., None, :], state.work[..., None], tau)

    def _settings(self, first: int) -> np.ndarray:
        """As the algorithms take them: the number of the first period, then the times."""
        return np.array([first, *self.plan.times])

    @property
    def _signals(self) -> tuple[Signal, Signal]:
        return self.tau, self.external

    # compiled

    @property
    def _recorded(self) -> tuple[tuple[int, ...], ...]:
        return (self.rig.nq,), (self.rig.nv,), ()

    def _run(self, first: int, frames: int, periods: int, recorded: list[np.ndarray]) -> None:
        """Run some frames from period `first` on, recording their beginnings."""
        moved, batch = np.empty_like(self.motion), self.batch
        table = [states(self.motion, batch, 1), states(self._settings(first), batch, 1)]
        for signal in self._signals:
            if signal.over_time is not None:
                array, step, *_ = states(signal.over_time, batch, len(signal.shape) + 1)
                row = 8 * math.prod(signal.shape)
                table.append((array, step, row, signal.turns[first:]))
            elif signal.value is not None:
                table.append(states(signal.value, batch, len(signal.shape)))
        if self._gravity_given:
            table.append(states(np.array(self.gravity), batch, 1))
        for array, shape in zip(recorded, self._recorded, strict=True):
            row = 8 * math.prod(shape)
            table.append((array, row * frames, row, None))
        table.append(states(moved, batch, 1))
        loops = frames, periods, self.plan.substeps
        self._kernel()(table, math.prod(batch), self.threads, loops, math.prod(loops))
        self.motion = moved

    @property
    def _gravity_given(self) -> bool:
        return self.gravity != GRAVITY

    def _kernel(self) -> Kernel:
        signals = [("rows" if s.over_time is not None else "value" if s.value is not None else "") for s in self._signals]
        one = math.prod(self.batch) == 1
        key = ("rollout", self.integrator, *signals, self.changes, self._gravity_given, one)
        kernels = kernels_of(self.rig)
        if key not in kernels:
            kernels[key] = compiled(self._program(signals, repr(key).encode()), False, 1 if one else None)
        return kernels[key]

    def _program(self, signals: list[str], key: bytes) -> Program:
        rig, method, like, changes = self.rig, self.method, self._like, self.changes
        size = len(flatten(like))

        def write(tape: Tape, motion: Nested, settings: Nested, *given: Any) -> list[Nested]:
            m, (first, *lengths), rest = mechanism(rig), settings, iter(given)
            times = Times(*lengths)
            tau, external = (next(rest) if signal else None for signal in signals)
            gravity = next(rest, GRAVITY)

            def forces() -> Forces:
                now = (x.row() if isinstance(x, Rows) else x for x in (tau, external))
                return _forces(m, next(now), next(now), gravity)

            def period(carry: list[Nested]) -> list[Nested]:
                k, motion = carry
                acting = forces()
                motion = method.resumed(m, motion, acting) if changes else motion
                clock = _clock(times, k, changes, tape.parameter(_SUBSTEPS))
                return [k + 1.0, method.advance(m, motion, acting, clock)]

            def frame(carry: list[Nested]) -> list[Nested]:
                k, motion = carry
                for result, value in enumerate(_parts(method.at(m, motion, k * times.period))):
                    tape.record(result, value)
                return repeat(tape.parameter(_PERIODS), period, carry)

            start = rebuilt(like, iter(motion))
            start = start if changes else method.resumed(m, start, forces())
            _, end = repeat(tape.parameter(_FRAMES), frame, [first, start])
            return [flatten(end)]

        shapes = {"tau": (rig.nv,), "external": (rig.nlinks, 6)}
        arguments = [Array("motion", (size,)), Array("settings", (1 + len(Times._fields),))]
        arguments += [Array(name, shapes[name], kind == "rows") for name, kind in zip(shapes, signals, strict=True) if kind]
        arguments += [Array("gravity", (3,))] * self._gravity_given
        recorded = zip(("q", "v", "work"), self._recorded, strict=True)
        return Program(
            name=f"rollout_{self.integrator}",
            content=key + content(rig),
            arguments=tuple(arguments),
            results=(*(Array(name, shape, rows=True) for name, shape in recorded), Array("motion", (size,))),
            write=write,
            watched=False,
        )


def _interpolated(m: Mechanism, motion: Nested, t: Scalar, integrator: str) -> Nested:
    method = INTEGRATORS[integrator]
    like = method.begin(_point(m.rig, [0.0] * (m.nq + m.nv + 1)), 0.0)
    return _parts(method.at(m, rebuilt(like, iter(motion)), t))


def _point(rig: Rig, scalars: list[Scalar]) -> Point:
    return Point(scalars[: rig.nq], scalars[rig.nq : rig.nq + rig.nv], scalars[rig.nq + rig.nv])


def _parts(point: Point) -> tuple[Nested, ...]:
    return point.q, point.v, point.work


def _forces(m: Mechanism, tau: Nested, external: Nested, gravity: Nested) -> Forces:
    return Forces([0.0] * m.nv if tau is None else tau, external, gravity)


def _clock(times: Times, k: Scalar, changes: bool, substeps: Any) -> Clock:
    """The k-th control period: if forces change, a step may not go beyond its end."""
    t_end = (k + 1.0) * times.period
    return Clock(t_end, t_end if changes else times.end, times, substeps)
