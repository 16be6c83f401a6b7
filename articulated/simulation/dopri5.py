"""The adaptive method of Dormand and Prince, order 5(4), with dense output of order 4; every state has its own step.

Dormand, Prince 1980; dense output: Shampine 1986, as in Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
II.6, table 6.1. All over scalars, with no branch on a value: what a state does not accept is kept out by masks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from articulated.dynamics.configuration import step_rate
from articulated.dynamics.loops.factor import Redundancy, entries
from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar, absolute, either, exp, log, maximum, minimum, sqrt, where
from articulated.simulation.forces import Forces
from articulated.simulation.runge_kutta import Point, Slope, Tableau, closed, moved, stage

DOPRI5 = Tableau(
    (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Weights of the difference to the embedded method of order 4; the seventh slope is the next step's first."""

_DENSE = (
    (-8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432),
    (0.0, 0.0, 0.0),
    (131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799),
    (-1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072),
    (127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632),
    (-282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844),
    (40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423),
)
"""Weights of θ², θ³ and θ⁴ in the step to the fraction θ of the way; θ itself belongs to the first slope alone."""

Choice = TypeVar("Choice", Point, Slope)

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0
_SMALLEST = 1e-13
"""A step shorter than this part of the time so far is a failure."""


@dataclass(frozen=True, eq=False)
class Adaptive:
    """A motion under way.

    Attributes:
        t, at, slope: how far it is, where, and the slope there.
        h: length of the next step.
        t0, start, slopes, taken: the last step that was accepted: from where, with which slopes, how long.
        steps: steps tried so far.
        failed: 1 where the step became too short, else 0.
    """

    t: Scalar
    at: Point
    slope: Slope
    h: Scalar
    t0: Scalar
    start: Point
    slopes: list[Slope]
    taken: Scalar
    steps: Scalar
    failed: Scalar


def begin(at: Point, h: Scalar, sizes: Sequence[int] = ()) -> Adaptive:
    """A motion that starts at time 0 with a first step of h, once `restarted` has given it a slope.

    `sizes`: rows of each loop.
    """
    zero = 0.0 * at.work
    still = [zero] * len(at.v)
    repeats = Redundancy([zero] * entries(sizes), [zero] * sum(sizes)) if sizes else None
    slope = Slope(still, still, zero, [zero] * len(at.pulls), repeats)
    return Adaptive(zero, at, slope, zero + h, zero, at, [slope] * 7, zero + 1.0, zero, zero)


def restarted(state: Adaptive, forces: Forces) -> Adaptive:
    """The same motion after its forces have changed."""
    return replace(state, slope=first_slope(state.at, forces))


def first_slope(at: Point, forces: Forces) -> Slope:
    """The slope at a point."""
    return stage(at, (), [], forces, 0.0)[0]


def at_rest(state: Adaptive, t_end: Scalar, max_steps: Scalar) -> Scalar:
    """Whether a state has reached `t_end`, or never will."""
    under_way = (state.t < t_end) & (state.failed < 0.5) & (state.steps < max_steps)
    return where(under_way, 0.0, 1.0) > 0.5


def attempt(
    state: Adaptive,
    forces: Forces,
    t_stop: Scalar,
    rtol: Scalar,
    atol: Scalar,
) -> Adaptive:
    """Try one step, not beyond `t_stop`."""
    mechanism, rest = forces.mechanism, t_stop - state.t
    # the last step ends exactly there; a rest that would leave a sliver is halved
    h = where(state.h >= rest, rest, where(2.0 * state.h > rest, 0.5 * rest, state.h))

    slopes, looped = [state.slope], None
    for row in DOPRI5.a[1:]:
        slope, looped = stage(state.at, row, slopes, forces, h)
        slopes.append(slope)
    step, arrived = moved(mechanism, state.at, DOPRI5.b, slopes, h)
    assert step is not None
    arrived = arrived if looped is None else closed(forces, arrived, looped)
    next_slope = first_slope(arrived, forces)
    # the same slope as seen from the start of the step is what error and dense output need
    slopes.append(replace(next_slope, step=step_rate(mechanism, step, arrived.v)))
    error = _error(mechanism, state.at, arrived, slopes, h, rtol, atol)

    accept = error <= 1.0
    factor = _SAFETY * exp(-0.2 * log(maximum(error, 1e-8)))
    factor = where(error == error, minimum(maximum(factor, _SHRINK), _GROW), _SHRINK)  # NaN: shrink
    factor = where(accept, factor, minimum(factor, 1.0))
    # a step cut short at t_stop says nothing against the longer one before it
    h_next = where(accept & (h < state.h), maximum(state.h, h * factor), h * factor)
    too_short = where(accept, 1.0, h_next) < _SMALLEST * maximum(absolute(state.t), 1.0)
    t = where(h == rest, t_stop, state.t + h)
    return Adaptive(
        t=where(accept, t, state.t),
        at=either(accept, arrived, state.at),
        slope=either(accept, next_slope, state.slope),
        h=h_next,
        t0=where(accept, state.t, state.t0),
        start=either(accept, state.at, state.start),
        slopes=either(accept, slopes, state.slopes),
        taken=where(accept, h, state.taken),
        steps=state.steps + 1.0,
        failed=where(too_short, 1.0, state.failed),
    )


def interpolated(mechanism: Mechanism, state: Adaptive, t: Scalar) -> Point:
    """Where the motion was at a time within its last step."""
    s = (t - state.t0) / state.taken
    weights = [s * s * (a + s * (b + s * c)) for a, b, c in _DENSE]
    weights[0] = weights[0] + s
    _, between = moved(mechanism, state.start, weights, state.slopes, state.taken)
    return either(state.t == t, state.at, replace(between, pulls=state.at.pulls))


def _error(
    mechanism: Mechanism, start: Point, end: Point, slopes: list[Slope], h: Scalar, rtol: Scalar, atol: Scalar
) -> Scalar:
    """Estimated error of a step over what is allowed, root mean square over coordinates."""
    total: Scalar = 0.0
    for n in range(mechanism.nv):
        e_step = h * sum(w * k.step[n] for w, k in zip(_ERROR, slopes, strict=True) if w)
        e_v = h * sum(w * k.v[n] for w, k in zip(_ERROR, slopes, strict=True) if w)
        # a configuration's scale is 1 rad or 1 m: its numbers depend on where zero happens to be
        size_v = maximum(absolute(start.v[n]), absolute(end.v[n]))
        a, b = e_step / (atol + rtol), e_v / (atol + rtol * size_v)
        total = total + a * a + b * b
    return sqrt(total / max(1, 2 * mechanism.nv))
