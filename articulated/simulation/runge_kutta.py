"""Runge-Kutta methods on the configuration manifold, after Munthe-Kaas.

A step from q0 is looked for as q0 ⊕ s, where s is a plain vector whose rate is `step_rate`: so each method keeps its order, and
quaternions their length. Hairer, Lubich, Wanner, Geometric Numerical Integration, IV.8.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.dynamics.configuration import integrate, step_rate
from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar, is_zero
from articulated.simulation.forces import Forces, acceleration_and_power


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
    """Where a motion is: configuration, velocity, and the work done on it so far by all forces but weight."""

    q: list[Scalar]
    v: list[Scalar]
    work: Scalar


@dataclass(frozen=True, eq=False)
class Slope:
    """Rates of the step from q0, of the velocity and of the work."""

    step: list[Scalar]
    v: list[Scalar]
    work: Scalar


def runge_kutta_step(tableau: Tableau, start: Point, forces: Forces, h: Scalar) -> Point:
    """One step of length h."""
    slopes: list[Slope] = []
    for row in tableau.a:
        slopes.append(stage(start, row, slopes, forces, h))
    return moved(forces.mechanism, start, tableau.b, slopes, h)[1]


def stage(
    start: Point,
    row: Sequence[float],
    slopes: Sequence[Slope],
    forces: Forces,
    h: Scalar,
) -> Slope:
    """The slope at the stage that these earlier slopes, so weighted, lead to."""
    step, at = moved(forces.mechanism, start, row, slopes, h)
    rate = at.v if step is None else step_rate(forces.mechanism, step, at.v)
    return Slope(rate, *acceleration_and_power(at.q, at.v, forces))


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
    return step, Point(integrate(mechanism, start.q, step), v, work)
