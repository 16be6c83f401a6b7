"""What follows a motion with drives: stiffly, loosely or not at all, joint by joint, and changes its mind while it runs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from articulated.characters.gains import felt_inertia
from articulated.dynamics.boundary import Argument, checked
from articulated.dynamics.functions import difference, integrate
from articulated.rig.errors import did_you_mean
from articulated.simulation import Command, Simulation, State
from articulated.simulation.actuation import gains
from articulated.trajectory import Motion

MODES = {"limp": 0.0, "driven": 1.0, "prescribed": 1.0}
"""Modes of joints, and how much of its drive each has."""

_STIFF = 1e4
"""A prescribed coordinate is held by a spring that a step follows to this part."""


@dataclass(frozen=True, eq=False)
class _Change:
    """Something that is to happen at a time, over a time."""

    time: float
    over: float
    joints: np.ndarray
    strength: float
    prescribed: bool


@dataclass(frozen=True, eq=False)
class _Aim:
    """What is followed from a time on: a motion, its time 0 at `start`, or a pose."""

    time: float
    over: float
    source: Motion | np.ndarray
    start: float
    loop: bool
    here: bool


class Tracker:
    """Follows a motion: a control for a simulation with drives.

        drives = art.tuned(rig, frequency=6.0, limit=400.0, help=2.0)
        simulation = art.Simulation(rig, dt=0.005, ground=True, actuation=drives)
        tracker = art.Tracker(simulation, walk)
        tracker.set("limp", at=2.0)  # falls
        tracker.aim(walk, at=4.0, over=1.5, here=True)  # and from where it lies
        tracker.set("driven", at=4.0, over=1.0)  # gets the pose back
        run = simulation.run(walk.q[0], walk.v[0], duration=8.0, control=tracker)

    A drive aims at where the motion will be at the end of the control period, and as fast as it will move there. Stiffness
    falls with a joint's strength, damping with the square root of that. A prescribed joint follows exactly, whatever it takes.
    The root of a free rig is a joint like others, if the simulation's `PD` has help for it. What has been asked for is kept
    here: a tracker belongs to one run at a time.
    """

    def __init__(
        self,
        simulation: Simulation,
        motion: Motion | ArrayLike,
        *,
        loop: bool = False,
        start: float = 0.0,
        velocity: bool = True,
    ):
        """Follow a motion, or hold a pose, from time `start` on; over and over if it is to `loop`.

        Raises:
            ValueError: the simulation has no drives, or the motion is another rig's.
        """
        if simulation.actuation is None:
            raise ValueError("the simulation has no drives to track a motion with; give it actuation=art.tuned(rig, …)")
        self.rig, self.velocity = simulation.rig, velocity
        own = gains(self.rig, simulation.actuation)
        self._period = simulation.dt * simulation.substeps
        driven = list(own.drives.coordinates)
        self._driven = np.zeros(self.rig.nv, dtype=bool)
        self._driven[driven] = True
        self._stiffness, self._damping = np.zeros(self.rig.nv), np.zeros(self.rig.nv)
        for name, into in (("stiffness", self._stiffness), ("damping", self._damping)):
            values = getattr(own, name)
            if values.ndim != 1:
                raise ValueError(f"{name} of the drives has shape {values.shape}; a tracker needs the same for all states")
            into[driven] = values
        self._limit = None
        if own.drives.limited:
            self._limit = np.full(self.rig.nv, math.inf)
            self._limit[driven] = own.limit
        self._stiff = _STIFF * felt_inertia(self.rig) / simulation.dt**2
        self._from = self._to = np.where(self._driven, 1.0, 0.0)
        self._since, self._over = np.zeros(self.rig.nv), np.zeros(self.rig.nv)
        self._prescribed = np.zeros(self.rig.nv, dtype=bool)
        self._changes: list[_Change] = []
        self._aims: list[_Aim] = []
        self._aim_now = self._aimed(motion, -math.inf, 0.0, loop, start, False)
        self._left: tuple[np.ndarray, float, float] | None = None  # configurations left, when, and over how long
        self._shift: np.ndarray | None = None
        self._time = -math.inf

    def set(
        self,
        mode: str | float,
        joints: str | Iterable[str] | None = None,
        *,
        at: float | None = None,
        over: float = 0.0,
    ) -> None:
        """Change the mode of joints.

        Args:
            mode: "limp", "driven" or "prescribed", or a strength from 0 to 1, which multiplies stiffness.
            joints: a name, or several; None is all that have drives, a helped root included.
            at: when [s]; None is now.
            over: how long strength takes to change [s]; "prescribed" starts at once.

        Raises:
            ValueError: the mode or a joint is unknown, a joint has no drive, or a time is impossible.
        """
        if not (mode in MODES if isinstance(mode, str) else 0.0 <= mode <= 1.0):
            raise ValueError(f"mode is {mode!r}; expected {', '.join(MODES)}, or a strength from 0 to 1")
        if not 0.0 <= over < math.inf or (at is not None and not math.isfinite(at)):
            raise ValueError(f"at is {at!r} and over is {over!r}; expected seconds, zero or more")
        some = self._driven.copy()
        if joints is not None:
            some[:] = False
            for name in [joints] if isinstance(joints, str) else joints:
                if name not in self.rig.joints:
                    hint = did_you_mean(name, self.rig.joints)
                    raise ValueError(f"rig {self.rig.name!r} has no moving joint {name!r}{hint}")
                part = self.rig.joints[name].v_slice
                if not self._driven[part].all():
                    raise ValueError(f"joint {name!r} has no drive; give the simulation's PD gains for it (a root: help)")
                some[part] = True
        strength = MODES[mode] if isinstance(mode, str) else float(mode)
        self._changes.append(_Change(self._time if at is None else at, over, some, strength, mode == "prescribed"))
        self._changes.sort(key=lambda change: change.time)

    def aim(
        self,
        motion: Motion | ArrayLike,
        *,
        at: float | None = None,
        over: float = 0.5,
        start: float = 0.0,
        loop: bool = False,
        here: bool = False,
    ) -> None:
        """Follow another motion, or hold a pose, coming from the pose that there is then.

        Args:
            motion: what to follow, or a configuration, shape (..., nq).
            at: when [s]; None is now.
            over: how long the way from one to the other takes [s].
            start: the motion's own time then [s].
            loop: over and over.
            here: where the root is then, instead of where the motion has it; its height is the motion's.

        Raises:
            ValueError: the motion is another rig's.
        """
        time = self._time if at is None else float(at)
        self._aims.append(self._aimed(motion, time, over, loop, time - start, here))
        self._aims.sort(key=lambda aim: aim.time)

    def strength(self, time: float) -> np.ndarray:
        """How much of its drive each coordinate has, shape (nv,)."""
        passed = np.where(self._over > 0.0, (time - self._since) / np.where(self._over > 0.0, self._over, 1.0), 1.0)
        return self._from + (self._to - self._from) * _eased(passed)

    def target(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Where it wants to be, and how fast, at a time: shapes (..., nq) and (..., nv)."""
        aim = self._aim_now
        if isinstance(aim.source, Motion):
            moment = time - aim.start
            q, v = aim.source.at(moment, loop=aim.loop), aim.source.velocity(moment, loop=aim.loop)
        else:
            q, v = aim.source, np.zeros(self.rig.nv)
        if self._shift is not None:
            q = np.broadcast_to(q, (*self._shift.shape[:-1], self.rig.nq)).copy()
            q[..., :2] += self._shift
        if self._left is not None:
            left, since, over = self._left
            part = float(_eased(np.array((time - since) / over)))
            q = integrate(self.rig, left, part * difference(self.rig, left, q))
            v = part * v
        return q, v

    def __call__(self, time: float, state: State) -> Command:
        """What drives are to do in the control period that begins now."""
        passed = time - self._time  # a run may shorten its steps
        period = min(self._period, passed) if passed > 0.0 else self._period
        self._time = time
        self._take_up(time, state)
        q, v = self.target(time + period)
        w = self.strength(time)
        stiffness, damping = w * self._stiffness, np.sqrt(w) * self._damping
        if self.velocity:
            # p (q + (d/p) v − q_now) − d v_now is p (q − q_now) + d (v − v_now)
            lead = np.where(stiffness > 0.0, damping / np.where(stiffness > 0.0, stiffness, 1.0), 0.0)
            q = integrate(self.rig, q, np.where(self._prescribed, 0.0, lead) * v)
        if not self._prescribed.any():
            return Command(q, stiffness, damping)
        held = self._prescribed
        limit = None if self._limit is None else np.where(held, math.inf, self._limit)
        return Command(q, np.where(held, self._stiff, stiffness), np.where(held, 0.0, damping), limit)

    def _take_up(self, time: float, state: State) -> None:
        """Changes whose time has come."""
        while self._changes and self._changes[0].time <= time + 1e-9:
            change = self._changes.pop(0)
            now, some = self.strength(time), change.joints
            self._from, self._to = np.where(some, now, self._from), np.where(some, change.strength, self._to)
            self._since = np.where(some, time, self._since)
            self._over = np.where(some, 0.0 if change.prescribed else change.over, self._over)
            self._prescribed = np.where(some, change.prescribed, self._prescribed)
        while self._aims and self._aims[0].time <= time + 1e-9:
            aim = self._aims.pop(0)
            self._aim_now, self._left, self._shift = aim, None, None
            if aim.here and any(self.rig.is_root(joint) for joint in self.rig.joints.values()):
                self._shift = state.q[..., :2] - self.target(time)[0][..., :2]
            self._left = (state.q.copy(), time, aim.over) if aim.over > 0.0 else None

    def _aimed(self, motion: Motion | ArrayLike, time: float, over: float, loop: bool, start: float, here: bool) -> _Aim:
        if not 0.0 <= over < math.inf:
            raise ValueError(f"over is {over!r}; expected seconds, zero or more")
        if isinstance(motion, Motion):
            if motion.rig.q_names != self.rig.q_names:
                raise ValueError(
                    f"the motion is of rig {motion.rig.name!r}; expected one of rig {self.rig.name!r}: art.retarget makes one"
                )
            return _Aim(time, over, motion, start, loop, here)
        pose = checked(self.rig, Argument("pose", motion, (self.rig.nq,), role="q"))
        return _Aim(time, over, np.asarray(pose, dtype=float), start, loop, here)


def _eased(part: np.ndarray) -> np.ndarray:
    """From 0 to 1 with no corners."""
    x = np.clip(part, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
