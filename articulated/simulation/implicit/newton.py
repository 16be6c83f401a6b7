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
from dataclasses import dataclass, replace
from functools import partial

from articulated.dynamics.sweep import Sweep
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, given, repeat, where
from articulated.simulation.implicit.line import Way
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


@dataclass(frozen=True, eq=False)
class Iterate:
    """What the solver carries from sweep to sweep.

    Attributes:
        k: how many sweeps so far.
        v: velocities of the coordinates that move with the load.
        pulls: impulses of loops with which A v − p = −Jᵀ y, too.
        u, y: velocities and impulses of the terms.
        limits: of the contacts' friction cones.
        error: Σ ‖g(u) − y‖², weighted, over the rig's mass [m²/s²].
    """

    k: Scalar
    v: list[Scalar]
    pulls: list[Scalar]
    u: Values
    y: Values
    limits: list[Scalar]
    error: Scalar


def begin(sweep: Sweep, terms: Terms, now: Tree, v: Sequence[Scalar]) -> Iterate:
    """Where the solver starts: at the velocities of the step before.

    How hard contacts would push then is how hard they may rub in the first sweep.
    """
    u = terms.velocities(now.velocities(v), v)

    def limit(k: int) -> list[Scalar]:
        contact = terms.contacts[k]
        return [contact.friction * contact.hinge.push(contact.n.dot(Vec3.of(u.contacts[k])))]

    limits = [x for (x,) in terms.near(limit, 1)]
    none = Values([[0.0] * 3 for _ in terms.contacts], [0.0] * len(terms.joints))
    return Iterate(0.0, [v[s] for s in sweep.moving], [0.0] * len(sweep.lines), u, none, limits, _FAR)


def solved(sweep: Sweep, terms: Terms, start: Iterate, mass: float, tolerance: Scalar, bend: Sequence[Scalar] = ()) -> Iterate:
    """The solution, or the best that so many sweeps find.

    Args:
        sweep: the step's linear system.
        terms: what acts.
        start: where to start.
        mass: of the rig.
        tolerance: of the residual, √error [m/s].
        bend: velocities of the rows of loops.
    """
    if not (terms.contacts or terms.joints):
        v, _, pulls = sweep.solve(sweep.unloaded(), bend, _REFINED)
        return replace(start, v=[v[s] for s in sweep.moving], pulls=pulls, error=0.0)

    def turn(at: Iterate) -> Iterate:
        v, pulls, way = _whole_step(sweep, terms, at, bend)
        alpha, square = way.searched(where(at.k < BOUNDED, 1.0, where(found(at), 1.0, 0.0)))
        u, y, limits = way.place(alpha)
        v, pulls = between(alpha, at.v, v), between(alpha, at.pulls, pulls)
        return Iterate(at.k + 1.0, v, pulls, u, y, limits, square * (1.0 / mass))

    def found(at: Iterate) -> Scalar:
        # what is not a number will not be one after more sweeps either
        return where(at.error >= tolerance * tolerance, 1.0, 0.0) < 0.5

    return repeat(MAX_SWEEPS, turn, replace(start, k=0.0, error=_FAR), found)


def _whole_step(sweep: Sweep, terms: Terms, at: Iterate, bend: Sequence[Scalar]) -> tuple[list[Scalar], list[Scalar], Way]:
    """The velocities and pulls that solve the linear system, and the way there."""
    theta = where(at.k < BOUNDED, 0.0, 1.0)
    load, g, y = sweep.unloaded(), Values([], []), Values([], [])
    reactions, slopes = [], []
    for contact, x, limit in zip(terms.contacts, at.u.contacts, at.limits, strict=True):
        u = Vec3.of(x)
        reactions.append(reaction := contact.reaction(u, limit, theta))
        load.on_body(contact.body, contact.near, *contact.act(reaction, u))
        g.contacts.append(list(reaction.g))
    for joint, u in zip(terms.joints, at.u.joints, strict=True):
        answer, G = joint.reaction(u, theta)
        if joint.rope is not None:
            load.on_line(joint.rope[0], *_linear(answer, G, u))
        else:
            load.on_joint(joint.direction, *given(joint.near, partial(_linear, answer, G, u), [0.0, 0.0]))
        g.joints.append(answer)
        slopes.append(G)
    v, V, pulls = sweep.solve(load, bend, _REFINED)
    u = terms.velocities(V, v)
    du = u.minus(at.u)
    for reaction, dx in zip(reactions, du.contacts, strict=True):
        y.contacts.append(list(reaction.g + reaction.times(Vec3.of(dx))))
    for answer, G, dx in zip(g.joints, slopes, du.joints, strict=True):
        y.joints.append(answer + G * dx)
    limits = [_limit(*some, at.k) for some in zip(terms.contacts, u.contacts, y.contacts, at.limits, strict=True)]
    return [v[s] for s in sweep.moving], pulls, Way(terms, limits, at.u, at.y, g, u, y, du, y.minus(at.y))


def _linear(answer: Scalar, G: Scalar, u: Scalar) -> list[Scalar]:
    """The mass and the momentum that act along a joint."""
    return [G, G * u - answer]


def _limit(contact: Contact, u: Three, y: Three, limit: Scalar, k: Scalar) -> Scalar:
    """Friction times how hard a contact pushes, as long as sweeps bound its slope; then as it was."""
    push = -contact.n.dot(Vec3.of(y))
    push = where(push > 0.0, push, contact.stopping(contact.n.dot(Vec3.of(u))))
    return where(k < BOUNDED, contact.friction * push, limit)
