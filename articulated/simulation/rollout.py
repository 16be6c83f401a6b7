"""The time loop: control periods one after the other, with a record at the start of each frame.

Compiled, frames, periods and steps are loops of one kernel, which keeps a block of states in its own scratch from the first
frame to the last. Interpreted, or with a control that has to be asked for, periods are turns of a loop in Python.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
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
from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Nested, Scalar, flatten, rebuilt, repeat
from articulated.simulation.cargo import Cargo
from articulated.simulation.control import Signal
from articulated.simulation.forces import Forces
from articulated.simulation.freight import Freight
from articulated.simulation.methods import INTEGRATORS, Clock, Motion, Times, layout
from articulated.simulation.runge_kutta import Point
from articulated.simulation.scene import Numbers, Scene
from articulated.simulation.state import State

_FRAMES, _PERIODS, _SUBSTEPS = range(3)
_CROWD, _TOGETHER = 32, 8
"""A batch of so many states is regrouped every so many steps."""
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


@dataclass(frozen=True, eq=False)
class World:
    """Where and under what a batch moves.

    Attributes:
        scene, integrator: what a step is compiled from.
        like: numbers of the scene, to tell their structure.
        numbers: their values, shape (..., n).
        gravity: acceleration of free fall.
        freight: particles that the rig carries, if there are any.
    """

    scene: Scene
    integrator: str
    like: Numbers
    numbers: np.ndarray
    gravity: tuple[float, ...]
    freight: Freight | None = None

    @cached_property
    def layout(self) -> Motion:
        """What the method carries, with the index of each scalar in place of it."""
        return layout(self.scene, self.integrator)

    @cached_property
    def size(self) -> int:
        """How many scalars that is."""
        return len(flatten(self.layout))


class Signals(NamedTuple):
    """What acts in each period: generalized forces, the configuration that drives hold to, and wrenches on links.

    And in each step what carried particles do to bodies. Gains of drives, if they change, are numbers of the scene.
    """

    tau: Signal
    target: Signal
    external: Signal
    towed: Signal


class Frames(NamedTuple):
    """Frames of a run: the number of the first, and arrays of shape (*batch, how many, …)."""

    first: int
    recorded: list[np.ndarray]
    tau: np.ndarray
    particles: np.ndarray | None = None


class Rollout:
    """A batch under way.

    Attributes:
        motion: what the method carries of each state, shape (*batch, size).
        shown: what the method shows of the step before, by name, as indices into its motion.
        recorded: shapes of what is kept of each frame: q, v, work, and what is shown.
    """

    def __init__(
        self, world: World, start: State, signals: Signals, plan: Plan, threads: int | None, gains: Signal | None = None
    ):
        self.world, self.signals, self.plan, self.threads = world, signals, plan, threads
        self.scene, self.rig, self.method = world.scene, world.scene.rig, INTEGRATORS[world.integrator]
        self.batch, self.dtype = start.work.shape, start.q.dtype
        self._tables = [np.ascontiguousarray(table, self.dtype) for table in self.scene.tables]
        self.changes = any(signal.changes for signal in signals)
        self.cargo = (
            None if start.particles is None or world.freight is None else Cargo(world.freight, start.particles, start.time)
        )
        asked = [*signals, gains] if gains is not None else signals
        self.asks = any(signal.function is not None for signal in asked) or self.cargo is not None
        self._like = world.layout
        self._gains, self._numbers, self._begins = gains, world.numbers, start.time
        self._size = world.size
        self.shown = self._shown(self._like)
        self.recorded = ((self.rig.nq,), (self.rig.nv,), (), *((len(part),) for part in self.shown.values()))
        self._set_gains()
        given = start.motion()
        self.motion = given if given.shape[-1] == self._size else self._begun(given[..., : self.rig.nq + self.rig.nv + 1])
        self._spare: np.ndarray | None = None  # memory to move into: what was moved from, if nobody else has it
        self._shared = True

    def run(self) -> Iterator[Frames]:
        """All frames, some at a time."""
        plan = self.plan
        last = plan.frames * plan.periods
        if interpreting() or self.asks:
            yield from self._period_by_period()
        elif math.prod(self.batch):
            yield from self._many_at_once()
        tau = self.signals.tau
        yield self._now(plan.frames, self.state(last), tau.value if self.asks else tau.rows(np.array([last - 1])))

    def step(self) -> None:
        """One control period."""
        if interpreting() or self.asks:
            self._update(0, self.state(0))
        self._period(0)

    def state(self, k: int) -> State:
        """Where the batch is at the start of period k."""
        t, motion = k * self.plan.times.period, self.motion
        nq, nv = self.rig.nq, self.rig.nv
        if self.method.interpolates:
            given = [Argument("motion", motion, motion.shape[-1:]), Argument("t", t, ())]
            options = {"watched": False, "integrator": self.world.integrator}
            options |= {"loops": self.scene.loops, "ropes": self.scene.ropes}
            size = nq + nv + 1 + len(self.scene.rows)
            motion = call(self.rig, _interpolated, given, (size,), None, self.threads, **options)
        self._shared = True
        return replace(
            State.of(self._begins + t, motion, nq, nv), particles=None if self.cargo is None else self.cargo.particles
        )

    def _shown(self, motion: Motion) -> dict[str, list[Any]]:
        """What the method shows of the step before, flat; without what is empty."""
        flat = {name: flatten(part) for name, part in self.method.shown(motion).items()}
        return {name: part for name, part in flat.items() if part}

    def _begun(self, point: np.ndarray) -> np.ndarray:
        motion = np.empty((*self.batch, self._size), self.dtype)
        h = np.broadcast_to(np.asarray(self.plan.times.h, self.dtype), self.batch)
        m = self.scene.mechanism
        evaluate(lambda x, h: flatten(self.method.begin(self.scene, _point(m, x), h)), [(point, 1), (h, 0)], motion, self.batch)
        return motion

    def reached(self) -> tuple[np.ndarray, np.ndarray] | None:
        """How far each state got [s], and whether its step became too short; None if no step can fail."""
        reached = self.method.reached(self.end())
        return (reached[0], reached[1] > 0.5) if reached else None

    @property
    def solves(self) -> bool:
        """Whether its steps are solutions of a problem, with a residual."""
        return self.world.integrator == "semi_implicit" and self.scene.is_one_sided

    def residual(self) -> np.ndarray:
        """The largest that a step of each state has left [m/s]."""
        return np.asarray(self.end().stance.residual, float) if self.solves else np.zeros(self.batch)

    def end(self) -> Motion:
        """What the method carries, one array a scalar."""
        return rebuilt(self._like, iter(np.moveaxis(self.motion, -1, 0)))

    def _period_by_period(self) -> Iterator[Frames]:
        for frame in range(self.plan.frames):
            for j in range(self.plan.periods):
                k = frame * self.plan.periods + j
                if j == 0 or self.asks:
                    state = self.state(k)
                self._update(k, state)
                if j == 0:
                    yield self._now(frame, state, self.signals.tau.value)
                self._period(k)

    def _update(self, k: int, state: State) -> None:
        """What acts in period k, found out."""
        time = self._begins + k * self.plan.times.period
        for signal in self.signals:
            signal.update(k, time, state)
        if self._gains is not None:
            self._gains.update(k, time, state)
            self._set_gains()

    def _set_gains(self) -> None:
        """Gains that change in their places among the scene's numbers."""
        self._numbers = self.world.numbers
        if self._gains is not None and (given := self._gains.value) is not None:
            numbers = np.broadcast_to(self._numbers, (*given.shape[:-1], self._numbers.shape[-1])).copy()
            numbers[..., -1 - given.shape[-1] : -1] = given  # the last is the solver's tolerance
            self._numbers = numbers

    def _period(self, k: int) -> None:
        if math.prod(self.batch) == 0:
            return
        if self.cargo is None:
            self._advance(k, self.plan.substeps)
            return
        nq, nv, towing = self.rig.nq, self.rig.nv, self.shown.get("towing", slice(0))  # nothing if all are loose
        for _ in range(self.plan.substeps):
            q, v = self.motion[..., :nq], self.motion[..., nq : nq + nv]
            self.signals.towed.value = self.cargo.towed(q, v, self.plan.times.h).astype(self.dtype, copy=False)
            self._advance(k, 1)
            self.cargo.follow(self.motion[..., :nq], self.motion[..., towing])

    def _advance(self, k: int, substeps: int) -> None:
        """So many steps under what acts in period k."""
        if not interpreting():
            self._run(k, 1, 1, None, substeps)
            return
        settings, numbers = self._settings(k), self._numbers
        given = [(self.motion, 1), (np.broadcast_to(settings, (*self.batch, *settings.shape)), 1)]
        given += [(np.broadcast_to(numbers, (*self.batch, numbers.shape[-1])), 1)]
        given += [(signal.value, len(signal.shape)) for signal in self.signals]
        resume = k == 0 or self.changes

        def algorithm(motion, settings, numbers, *signals):
            forces = self._forces(signals, numbers, self.world.gravity, self.scene.tables)
            motion = rebuilt(self._like, iter(motion))
            motion = self.method.resumed(motion, forces) if resume else motion
            clock = _clock(Times(*settings[1:]), settings[0], self.changes, substeps)
            return flatten(self.method.advance(motion, forces, clock))

        moved = np.empty_like(self.motion)
        evaluate(algorithm, given, moved, self.batch)
        self.motion = moved

    def _many_at_once(self) -> Iterator[Frames]:
        plan, frames = self.plan, self.plan.frames
        work = self._kernel().cost(math.prod(self.batch)) * plan.periods * plan.substeps  # for a frame
        share = max(1, min(frames, int(_PATIENCE / max(work, 1e-9))))
        if self._regroups:
            share = max(1, min(share, _TOGETHER // (plan.periods * plan.substeps)))
        for first in range(0, frames, share):
            count = min(share, frames - first)
            arrays = [np.empty((*self.batch, count, *shape), self.dtype) for shape in self.recorded]
            self._run(first * plan.periods, count, plan.periods, arrays)
            yield Frames(first, arrays, self.signals.tau.rows(np.arange(first, first + count) * plan.periods))

    def _now(self, frame: int, state: State, tau: np.ndarray | None) -> Frames:
        if tau is None:
            tau = np.zeros((*self.batch, 1, self.rig.nv))
        elif tau.ndim == len(self.batch) + 1:
            tau = tau[..., None, :]
        shown = [self.motion[..., None, part] for part in self.shown.values()]
        particles = None if state.particles is None else state.particles[..., None, :, :]
        return Frames(frame, [state.q[..., None, :], state.v[..., None, :], state.work[..., None], *shown], tau, particles)

    def _settings(self, first: int) -> np.ndarray:
        """As the algorithms take them: the number of the first period, then the times."""
        return np.array([first, *self.plan.times], self.dtype)

    def _forces(self, signals: Sequence[Nested], numbers: Nested, gravity: Nested, tables: Sequence[Any]) -> Forces:
        tau, target, external, towed = signals
        nothing = [0.0] * self.rig.nv
        given = rebuilt(self.world.like, iter(numbers))
        tau, target = nothing if tau is None else tau, () if target is None else target
        return Forces(self.scene, tau, external, gravity, given, target, tables, () if towed is None else towed)

    # compiled

    def _run(
        self, first: int, frames: int, periods: int, recorded: list[np.ndarray] | None, substeps: int | None = None
    ) -> None:
        """Run some frames from period `first` on, recording their beginnings, if wanted.

        Where states are regrouped, a few steps at a time; only the first piece of a frame begins it.
        """
        substeps = self.plan.substeps if substeps is None else substeps
        if not self._regroups or frames * periods * substeps <= _TOGETHER:
            self._run_piece(first, (frames, periods, substeps), recorded)
            return
        for frame in range(frames):
            here = (*[slice(None)] * len(self.batch), slice(frame, frame + 1))
            into = None if recorded is None else [array[here] for array in recorded]
            for k, some, parts in _pieces(periods, substeps):
                self._run_piece(first + frame * periods + k, (1, some, parts), into)
                into = None

    def _run_piece(self, first: int, loops: tuple[int, int, int], recorded: list[np.ndarray] | None) -> None:
        moved, batch, size = self._spare, self.batch, self.dtype.itemsize
        if moved is None:
            moved = np.empty_like(self.motion)
        table = [states(self.motion, batch, 1), states(self._settings(first), batch, 1)]
        table.append(states(self._numbers.astype(self.dtype, copy=False), batch, 1))
        for signal in self.signals:
            if signal.over_time is not None:
                array, step, *_ = states(signal.over_time, batch, len(signal.shape) + 1)
                table.append((array, step, size * math.prod(signal.shape), signal.turns[first:]))
            elif signal.value is not None:
                table.append(states(signal.value, batch, len(signal.shape)))
        for heights in self._tables:
            table.append((heights, 0, 0, None))
        if self._gravity_given:
            table.append(states(np.array(self.world.gravity, self.dtype), batch, 1))
        if recorded is None:  # what nobody wants has one place for all
            table += [(np.empty(math.prod(shape), self.dtype), 0, 0, None) for shape in self.recorded]
        for array, shape in zip(recorded or (), self.recorded, strict=recorded is not None):
            row = size * math.prod(shape)
            stride = array.strides[len(batch) - 1] if batch else 0
            table.append((array, stride, row, None))
        table.append(states(moved, batch, 1))
        self._kernel()(table, math.prod(batch), self.threads, loops, math.prod(loops), self._order())
        self._spare = None if self._shared else self.motion
        self.motion, self._shared = moved, False

    def _order(self) -> np.ndarray | None:
        """Side by side states whose steps are alike: a group does all that any of its states needs, as often as its slowest."""
        if not self._regroups:
            return None
        stance = self._like.stance
        return np.lexsort([self.motion[..., k].ravel().astype(np.int32) for k in (stance.latest, stance.near, stance.met)])

    @property
    def _regroups(self) -> bool:
        return self.solves and math.prod(self.batch) >= _CROWD

    @property
    def _gravity_given(self) -> bool:
        return self.world.gravity != GRAVITY

    def _kernel(self) -> Kernel:
        signals = [("rows" if s.over_time is not None else "value" if s.value is not None else "") for s in self.signals]
        one, single = math.prod(self.batch) == 1, self.dtype == np.float32
        key = ("rollout", self.world.integrator, self.scene.content, *signals, self.changes, self._gravity_given)
        kernels = kernels_of(self.rig)
        if (*key, one, single) not in kernels:
            program = self._program(signals, repr(key).encode())
            kernels[(*key, one, single)] = compiled(program, single, 1 if one else None)
        return kernels[(*key, one, single)]

    def _program(self, kinds: list[str], key: bytes) -> Program:
        scene, method, like, changes, rig = self.scene, self.method, self._like, self.changes, self.rig

        def write(tape: Tape, motion: Nested, settings: Nested, numbers: Nested, *given: Any) -> list[Nested]:
            (first, *lengths), rest = settings, iter(given)
            times = Times(*lengths)
            signals = [next(rest) if kind else None for kind in kinds]
            tables = [next(rest) for _ in self._tables]
            gravity = next(rest, GRAVITY)

            def forces() -> Forces:
                return self._forces([x.row() if isinstance(x, Rows) else x for x in signals], numbers, gravity, tables)

            def period(carry: list[Nested]) -> list[Nested]:
                k, motion = carry
                acting = forces()
                motion = method.resumed(motion, acting) if changes else motion
                clock = _clock(times, k, changes, tape.parameter(_SUBSTEPS))
                return [k + 1.0, method.advance(motion, acting, clock)]

            def frame(carry: list[Nested]) -> list[Nested]:
                k, motion = carry
                point = method.at(scene, motion, k * times.period)
                for result, value in enumerate((point.q, point.v, point.work, *self._shown(motion).values())):
                    tape.record(result, value)
                return repeat(tape.parameter(_PERIODS), period, carry)

            start = rebuilt(like, iter(motion))
            start = start if changes else method.resumed(start, forces())
            _, end = repeat(tape.parameter(_FRAMES), frame, [first, start])
            return [flatten(end)]

        shapes = ("tau", (rig.nv,)), ("target", (rig.nq,)), ("external", (rig.nlinks, 6)), ("towed", self.signals.towed.shape)
        arguments = [Array("motion", (self._size,)), Array("settings", (1 + len(Times._fields),))]
        arguments += [Array("numbers", (self.world.numbers.shape[-1],))]
        arguments += [Array(name, shape, kind == "rows") for (name, shape), kind in zip(shapes, kinds, strict=True) if kind]
        arguments += [Array(f"heights{k}", table.shape, table=True) for k, table in enumerate(self._tables)]
        arguments += [Array("gravity", (3,))] * self._gravity_given
        names = ("q", "v", "work", *self.shown)
        results = [Array(name, shape, rows=True) for name, shape in zip(names, self.recorded, strict=True)]
        return Program(
            name=f"rollout_{self.world.integrator}",
            content=key,
            arguments=tuple(arguments),
            results=(*results, Array("motion", (self._size,))),
            write=write,
            watched=False,
            ordered=self.solves,
        )


def _pieces(periods: int, substeps: int) -> Iterator[tuple[int, int, int]]:
    """A frame a few steps at a time: the first period of each piece, how many periods, and how many substeps of each."""
    if substeps < _TOGETHER:
        most = _TOGETHER // substeps
        yield from ((k, min(most, periods - k), substeps) for k in range(0, periods, most))
        return
    for k in range(periods):
        yield from ((k, 1, min(_TOGETHER, substeps - n)) for n in range(0, substeps, _TOGETHER))


def _interpolated(m: Mechanism, motion: Nested, t: Scalar, integrator: str, **loops: Any) -> Nested:
    method, scene = INTEGRATORS[integrator], Scene(m.rig, **loops)
    point = method.at(scene, rebuilt(layout(scene, integrator), iter(motion)), t)
    return point.q, point.v, point.work, point.pulls


def _point(m: Mechanism, scalars: list[Scalar]) -> Point:
    return Point(scalars[: m.nq], scalars[m.nq : m.nq + m.nv], scalars[m.nq + m.nv])


def _clock(times: Times, k: Scalar, changes: bool, substeps: Any) -> Clock:
    """The k-th control period: if forces change, a step may not go beyond its end."""
    t_end = (k + 1.0) * times.period
    return Clock(t_end, t_end if changes else times.end, times, substeps)
