"""Runge-Kutta methods on the configuration manifold, after Munthe-Kaas.

A step from q0 is looked for as q0 ⊕ s, where s is a plain vector whose rate is `step_rate`: so each method keeps its order, and
quaternions their length. Hairer, Lubich, Wanner, Geometric Numerical Integration, IV.8.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from articulated.dynamics.configuration import integrate, step_rate
from articulated.dynamics.loops.constrained import Constrained, rows_at, speeds
from articulated.dynamics.loops.factor import Redundancy
from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar, is_zero
from articulated.simulation.forces import Forces, rate

_AFAR = 3
"""Corrections after a step whose last stage was not at its end."""


@dataclass(frozen=True)
class Tableau:
    """An explicit method: stages a and weights b."""

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]


EULER = Tableau(((),), (1.0,))
MIDPOINT = Tableau(((), (1 / 2,)), (0.0, 1.0))
RK4 = Tableau(((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6))


@dataclass(frozen=True, eq=False)
class Point:
    """Where a motion is.

    Attributes:
        q, v: configuration and velocity.
        work: done on it so far by all forces but weight.
        pulls: forces of loops as the last step began, a row each.
    """

    q: list[Scalar]
    v: list[Scalar]
    work: Scalar
    pulls: list[Scalar] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Slope:
    """Rates of the step from q0, of the velocity and of the work; forces of loops, and how their rows repeat each other."""

    step: list[Scalar]
    v: list[Scalar]
    work: Scalar
    pulls: list[Scalar] = field(default_factory=list)
    redundancy: Redundancy | None = None


def runge_kutta_step(tableau: Tableau, start: Point, forces: Forces, h: Scalar) -> Point:
    """One step of length h."""
    slopes: list[Slope] = []
    looped = None
    for row in tableau.a:
        slope, looped = stage(start, row, slopes, forces, h)
        slopes.append(slope)
    end = moved(forces.mechanism, start, tableau.b, slopes, h)[1]
    return end if looped is None else closed(forces, end, looped, 1 if sum(tableau.a[-1]) == 1.0 else _AFAR)


def closed(forces: Forces, end: Point, looped: Constrained, corrections: int = 1) -> Point:
    """The nearest point, by kinetic energy, with loops closed and velocities that keep them so.

    The linear system is that of the last stage: if it was not at the end of the step, several corrections are needed.
    """
    m, loops, q, opening = forces.mechanism, forces.scene.loops, end.q, []
    for _ in range(corrections):
        now, rows = rows_at(m, loops, q)
        opening = speeds(now, rows, end.v)
        q = integrate(m, q, looped.projected([-line.gap for line in rows]))
    dv = looped.projected([-x for x in opening])
    return replace(end, q=q, v=[a + b for a, b in zip(end.v, dv, strict=True)])


def stage(
    start: Point,
    row: Sequence[float],
    slopes: Sequence[Slope],
    forces: Forces,
    h: Scalar,
) -> tuple[Slope, Constrained | None]:
    """The slope at the stage that these earlier slopes, so weighted, lead to; and the system of its loops, if there are any."""
    step, at = moved(forces.mechanism, start, row, slopes, h)
    along = at.v if step is None else step_rate(forces.mechanism, step, at.v)
    there = rate(at.q, at.v, forces, slopes[0].redundancy if slopes else None)
    redundancy = None if there.looped is None else there.looped.sweep.redundancy
    return Slope(along, there.a, there.power, there.pulls, redundancy), there.looped


def moved(
    mechanism: Mechanism, start: Point, weights: Sequence[Scalar], slopes: Sequence[Slope], h: Scalar
) -> tuple[list[Scalar] | None, Point]:
    """The step h Σ w_i k_i from a point (None if there is none), and where it leads."""
    weighted = [(w, slope) for w, slope in zip(weights, slopes, strict=True) if not is_zero(w)]
    if not weighted:
        return None, start
    step = [h * sum(w * k.step[n] for w, k in weighted) for n in range(mechanism.nv)]
    v = [x + h * sum(w * k.v[n] for w, k in weighted) for n, x in enumerate(start.v)]
    work = start.work + h * sum(w * k.work for w, k in weighted)
    return step, Point(integrate(mechanism, start.q, step), v, work, slopes[0].pulls)
