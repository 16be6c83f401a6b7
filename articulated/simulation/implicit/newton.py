"""The solver of a step: minimise ½ (v − v*)ᵀ A (v − v*) + Σ ℓ(u), u = J v, over the velocity v at the end of the step.

Of all v that keep loops closed, that is: with these, too, every step is linear, and the line search need not know of them.

Newton's method, whose linear system is one sweep of the articulated-body algorithm. The first sweeps bound the slope of
friction (θ = 0: it cannot overshoot), and find how hard contacts push, which is how hard they can rub; then that stays.

symbol   meaning                                                    unit
u        velocity of each term                                      m/s
y        impulse of each term with which A v − p = −Jᵀ y            N s
α        length of a step: v, u and y all move by this part of the way

Neither the line search nor the test for the end, g(u) = y, needs a sweep. That holds once the first full step is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from articulated.dynamics.sweep import Sweep
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, repeat, where
from articulated.simulation.implicit import conjugate
from articulated.simulation.implicit.iterate import Iterate
from articulated.simulation.implicit.laws import dot
from articulated.simulation.implicit.line import Way
from articulated.simulation.implicit.linear import Linear
from articulated.simulation.implicit.terms import Contact
from articulated.simulation.implicit.values import Terms, Three, Values, between
from articulated.spatial import Vec3

MAX_SWEEPS = 40
BOUNDED = 3
"""Sweeps that bound the slope of friction."""

_REFINED = 0
"""How often a sweep's solution for the pulls of loops is refined: positions are corrected besides."""

_FAR = 1e30
"""An error before there is any."""


def begin(sweep: Sweep, terms: Terms, now: Tree, v: Sequence[Scalar], bend: Sequence[Scalar] = ()) -> Iterate:
    """Where the solver starts: at the velocities of the step before.

    How hard contacts would push then is how hard they may rub in the first sweep. `bend` are velocities of the rows of loops.
    """
    u = terms.velocities(now.velocities(v), v)

    def limit(contact: Contact, u: Sequence[Scalar]) -> list[Scalar]:
        return [contact.friction * contact.hinge.push(contact.n.dot(Vec3.of(u)))]

    limits = [x for (x,) in terms.near(limit, 1, u.contacts)]
    none = Values([[0.0] * 3 for _ in terms.contacts], [0.0] * len(terms.joints))
    start = Iterate(0.0, [v[s] for s in sweep.moving], [0.0] * len(sweep.lines), u, none, limits, _FAR, [], 0.0)
    return start if sweep.holds_pairs(terms.couplings) else conjugate.begin(sweep, terms, start, bend)


def solved(sweep: Sweep, terms: Terms, start: Iterate, mass: float, tolerance: Scalar, bend: Sequence[Scalar] = ()) -> Iterate:
    """The solution, or the best that so many sweeps find.

    Args:
        sweep: the step's linear system.
        terms: what acts.
        start: where to start.
        mass: of the rig.
        tolerance: of the residual, √error [m/s].
        bend: as of `begin`.
    """
    if not (terms.contacts or terms.joints):
        v, _, pulls = sweep.solve(sweep.unloaded(), bend, _REFINED)
        return replace(start, v=[v[s] for s in sweep.moving], pulls=pulls, error=0.0)

    def turn(at: Iterate) -> Iterate:
        theta = where(at.k < BOUNDED, 0.0, 1.0)
        linear = Linear.of(terms, at.u, at.limits, theta)
        end = _solution(sweep, linear, at, bend)
        way = _way(linear, at, end)
        alpha, square = way.searched(where(at.k < BOUNDED, 1.0, where(found(at), 1.0, 0.0)))
        u, y, limits = way.place(alpha)
        v, pulls, left = (between(alpha, a, b) for a, b in ((at.v, end.v), (at.pulls, end.pulls), (at.left, end.left)))
        (slack,) = between(alpha, [at.slack], [end.slack])
        return Iterate(at.k + 1.0, v, pulls, u, y, limits, (square + slack * slack) * (1.0 / mass), left, slack)

    def found(at: Iterate) -> Scalar:
        # what is not a number will not be one after more sweeps either
        return where(at.error >= tolerance * tolerance, 1.0, 0.0) < 0.5

    return repeat(MAX_SWEEPS, turn, replace(start, k=0.0, error=_FAR), found)


def _solution(sweep: Sweep, linear: Linear, at: Iterate, bend: Sequence[Scalar]) -> Iterate:
    """What solves the linear system, with velocities and impulses of the terms."""
    terms = linear.terms
    if sweep.holds_pairs(terms.couplings):
        v, V, pulls = sweep.solve(linear.add(sweep.unloaded(), pairs=True), bend, _REFINED)
        left, slack = [], 0.0
    else:
        v, V, pulls, left, slack = conjugate.solve(sweep, linear, at)
    u = terms.velocities(V, v)
    y = linear.answer(u)

    def limit(contact: Contact, u: Three, y: Three, limit: Scalar) -> list[Scalar]:
        return [_limit(contact, u, y, limit, at.k)]

    limits = [x for (x,) in terms.each(limit, 1, u.contacts, y.contacts, at.limits)]
    return Iterate(at.k, [v[s] for s in sweep.moving], pulls, u, y, limits, at.error, left, slack)


def _way(linear: Linear, at: Iterate, end: Iterate) -> Way:
    """From an iterate to the solution of its linear system."""
    dv = [b - a for a, b in zip(at.v, end.v, strict=True)]
    unsolved = (dot(dv, at.left), dot(dv, end.left)) if end.left else (0.0, 0.0)
    return Way(linear.terms, end.limits, at.u, at.y, linear.g, end.u, end.y, unsolved)


def _limit(contact: Contact, u: Three, y: Three, limit: Scalar, k: Scalar) -> Scalar:
    """Friction times how hard a contact pushes, as long as sweeps bound its slope; then as it was."""
    push = -contact.n.dot(Vec3.of(y) + contact.already)
    push = where(push > 0.0, push, contact.stopping(contact.n.dot(Vec3.of(u))))
    return where(k < BOUNDED, contact.friction * push, limit)
