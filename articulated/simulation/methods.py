"""Methods of integration as seen from outside: what moves a state through one control period.

All over scalars. A `Motion` is whatever a method carries from step to step: a `Point`, for dopri5 an `Adaptive`, and for the
implicit step a `Standing`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from articulated.dynamics.loops.closure import sizes
from articulated.dynamics.loops.constrained import closed_state
from articulated.scalar import Scalar, flatten, rebuilt, repeat, where
from articulated.simulation import dopri5
from articulated.simulation.forces import Forces
from articulated.simulation.implicit.stance import Standing, unmoved
from articulated.simulation.implicit.step import semi_implicit_step
from articulated.simulation.runge_kutta import EULER, MIDPOINT, RK4, Point, Tableau, runge_kutta_step
from articulated.simulation.scene import Scene

Motion = Any

_UNLIMITED = 1 << 60


class Times(NamedTuple):
    """Lengths of a run's parts, and what an adaptive method is asked for.

    Attributes:
        period: length of a control period [s].
        end: when the run ends [s].
        h: length of a step, or of the first one to try [s].
        rtol, atol: tolerances of an adaptive method.
        max_steps: how many it may take.
    """

    period: Scalar
    end: Scalar
    h: Scalar
    rtol: Scalar
    atol: Scalar
    max_steps: Scalar


@dataclass(frozen=True)
class Clock:
    """A control period, and how it is to be divided.

    Attributes:
        t_end: where it ends [s].
        t_stop: until when the forces stay the same; steps may go beyond the period's end, but not beyond this [s].
        times: of the run.
        substeps: of a method with steps of one length.
    """

    t_end: Scalar
    t_stop: Scalar
    times: Times
    substeps: Any


class Fixed:
    """Steps of one length."""

    interpolates = False
    """Whether a motion has to be asked where it is."""

    def __init__(self, step: Callable[[Any, Forces, Scalar], Any]):
        self.step = step

    def begin(self, scene: Scene, start: Point, h: Scalar) -> Motion:
        """The motion that starts at a point; complete once it is `resumed`."""
        return replace(start, pulls=[0.0] * len(scene.rows))

    def remembers(self, scene: Scene) -> int:
        """How many numbers it carries from one `Simulation.step` to the next, besides q, v and work."""
        return len(scene.rows)

    def resumed(self, motion: Motion, forces: Forces) -> Motion:
        """The motion under new forces."""
        return motion

    def advance(self, motion: Motion, forces: Forces, clock: Clock) -> Motion:
        """The motion at the end of a control period."""
        return repeat(clock.substeps, lambda point: self.step(point, forces, clock.times.h), motion)

    def at(self, scene: Scene, motion: Motion, t: Scalar) -> Point:
        """Where it is at a time that it has just reached or passed; not a number if it never got there."""
        return motion

    def reached(self, motion: Motion) -> list[Scalar]:
        """How far it got [s], and whether its step became too short; nothing if no step can fail."""
        return []

    def shown(self, motion: Motion) -> dict[str, Any]:
        """What is recorded of the last step, besides where it led."""
        return {"loop_forces": motion.pulls}


class Implicit(Fixed):
    """Steps of one length that carry a stance with them."""

    def begin(self, scene: Scene, start: Point, h: Scalar) -> Standing:
        return Standing(start.q, start.v, start.work, unmoved(scene))

    def remembers(self, scene: Scene) -> int:
        return len(flatten(unmoved(scene)))

    def at(self, scene: Scene, motion: Standing, t: Scalar) -> Point:
        return Point(motion.q, motion.v, motion.work, motion.stance.pulls)

    def shown(self, motion: Standing) -> dict[str, Any]:
        return {
            "before": motion.stance.before,
            "contact_forces": motion.stance.contact_forces,
            "pair_forces": motion.stance.pair_forces,
            "efforts": motion.stance.efforts,
            "loop_forces": motion.stance.pulls,
            "carry": motion.stance.carry,
            "towing": motion.stance.towing,
        }


class Adaptive(Fixed):
    """Steps of dopri5, each state its own; where forces stay the same, steps cross periods, which are interpolated."""

    interpolates = True

    def __init__(self):
        """There is nothing to choose."""

    def begin(self, scene: Scene, start: Point, h: Scalar) -> Motion:
        return dopri5.begin(super().begin(scene, start, h), h, sizes(scene.loops))

    def resumed(self, motion: Motion, forces: Forces) -> Motion:
        return dopri5.restarted(motion, forces)

    def advance(self, motion: Motion, forces: Forces, clock: Clock) -> Motion:
        def attempt(motion: Motion) -> Motion:
            return dopri5.attempt(motion, forces, clock.t_stop, clock.times.rtol, clock.times.atol)

        def done(motion: Motion) -> Scalar:
            return dopri5.at_rest(motion, clock.t_end, clock.times.max_steps)

        return repeat(_UNLIMITED, attempt, motion, done)

    def at(self, scene: Scene, motion: Motion, t: Scalar) -> Point:
        point = dopri5.interpolated(scene.mechanism, motion, t)
        if scene.loops:
            point = replace(point, **dict(zip("qv", closed_state(scene.mechanism, scene.loops, point.q, point.v), strict=True)))
        q, v, work = ([where(motion.t < t, float("nan"), x) for x in flatten(part)] for part in (point.q, point.v, point.work))
        return Point(q, v, work[0], point.pulls)

    def shown(self, motion: Motion) -> dict[str, Any]:
        return {"loop_forces": motion.at.pulls}

    def reached(self, motion: Motion) -> list[Scalar]:
        return [motion.t, motion.failed]


def _runge_kutta(tableau: Tableau) -> Fixed:
    return Fixed(lambda point, forces, h: runge_kutta_step(tableau, point, forces, h))


INTEGRATORS: dict[str, Fixed] = {
    "semi_implicit": Implicit(semi_implicit_step),
    "euler": _runge_kutta(EULER),
    "midpoint": _runge_kutta(MIDPOINT),
    "rk4": _runge_kutta(RK4),
    "dopri5": Adaptive(),
}
"""The methods by name."""


def layout(scene: Scene, integrator: str) -> Motion:
    """A method's motion with the index of each scalar in place of it: q, v and work come first."""
    m = scene.mechanism
    like = INTEGRATORS[integrator].begin(scene, Point([0.0] * m.nq, [0.0] * m.nv, 0.0), 0.0)
    return rebuilt(like, iter(range(len(flatten(like)))))
