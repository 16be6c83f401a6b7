"""The solver of a step: minimise ½ (v − v*)ᵀ A (v − v*) + Σ ℓ(u), u = J v, over the velocity v at the end of the step.

Newton's method, whose linear system is one sweep of the articulated-body algorithm. The first sweeps bound the slope of
friction (θ = 0: it cannot overshoot), and find how hard contacts push, which is how hard they can rub; then that stays.

symbol   meaning                                                    unit
u        velocity of each term                                      m/s
y        impulse of each term with which A v − p = −Jᵀ y            N s
α        length of a step: v, u and y all move by this part of the way

Along a step the slope of what is minimised is known from the terms alone: φ'(α) = Σ (g(u + α δu) − y − α δy) · δu. So neither
the line search nor the test for the end, g(u) = y, needs a sweep. That holds once the first full step is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, absolute, maximum, minimum, repeat, where
from articulated.simulation.implicit.sweep import Load, Sweep
from articulated.simulation.implicit.terms import Bend, Contact, JointTerm
from articulated.spatial import Motion, Vec3

MAX_SWEEPS = 40
BOUNDED = 3
"""Sweeps that bound the slope of friction."""
_SEARCHES = 6
_DOWNHILL, _FLAT = 0.5, 0.01
"""A step is taken whole if the slope at its end is at most the first part of that at its beginning; else only so far that it is
the second. Short steps must be good ones, or sliding contacts take turns for ever.
"""

_FAR = 1e30
"""An error before there is any."""

Three = list[Scalar]


@dataclass(frozen=True, eq=False)
class Terms:
    """All terms of a step."""

    contacts: Sequence[Contact]
    joints: Sequence[JointTerm]

    def velocities(self, V: Sequence[Motion], v: Sequence[Scalar]) -> Values:
        """u."""
        return Values([list(c.velocity(V)) for c in self.contacts], [j.velocity(v) for j in self.joints])

    def answers(self, u: Values, y: Values, limits: Sequence[Scalar]) -> tuple[Values, Scalar]:
        """g(u) − y, and Σ ‖g(u) − y‖², weighted [m²/s² kg]."""
        off = Values([], [])
        square: Scalar = 0.0
        for contact, x, f, limit in zip(self.contacts, u.contacts, y.contacts, limits, strict=True):
            g, part = contact.answer(Vec3.of(x), Vec3.of(f), limit)
            off.contacts.append(list(g))
            square = square + part
        for joint, x, f in zip(self.joints, u.joints, y.joints, strict=True):
            g, part = joint.answer(x, f)
            off.joints.append(g)
            square = square + part
        return off, square

    def bends(self, u: Values, du: Values, limits: Sequence[Scalar]) -> list[Bend]:
        """Of each term along du."""
        parts = [
            contact.bend(Vec3.of(x), Vec3.of(dx), limit)
            for contact, x, dx, limit in zip(self.contacts, u.contacts, du.contacts, limits, strict=True)
        ]
        return [*parts, *(j.bend(x, dx) for j, x, dx in zip(self.joints, u.joints, du.joints, strict=True))]


@dataclass(frozen=True, eq=False)
class Values:
    """Velocities or impulses of all terms: of contacts in world axes, of joints along their directions."""

    contacts: list[Three]
    joints: list[Scalar]

    def moved(self, alpha: Scalar, to: Values) -> Values:
        """This part of the way to others; all of it is exactly these."""
        left = 1.0 - alpha
        return Values(
            [[y - left * (y - x) for x, y in zip(a, b, strict=True)] for a, b in zip(self.contacts, to.contacts, strict=True)],
            [y - left * (y - x) for x, y in zip(self.joints, to.joints, strict=True)],
        )

    def minus(self, other: Values) -> Values:
        return Values(
            [[x - y for x, y in zip(a, b, strict=True)] for a, b in zip(self.contacts, other.contacts, strict=True)],
            [x - y for x, y in zip(self.joints, other.joints, strict=True)],
        )

    def dot(self, other: Values) -> Scalar:
        parts = [x * y for a, b in zip(self.contacts, other.contacts, strict=True) for x, y in zip(a, b, strict=True)]
        return sum([*parts, *(x * y for x, y in zip(self.joints, other.joints, strict=True))], 0.0)


@dataclass(frozen=True, eq=False)
class Iterate:
    """What the solver carries from sweep to sweep.

    Attributes:
        k: how many sweeps so far.
        v: velocities of the coordinates that move with the load.
        u, y: velocities and impulses of the terms.
        limits: of the contacts' friction cones.
        error: Σ ‖g(u) − y‖², weighted, over the rig's mass [m²/s²].
    """

    k: Scalar
    v: list[Scalar]
    u: Values
    y: Values
    limits: list[Scalar]
    error: Scalar


def begin(sweep: Sweep, terms: Terms, now: Tree, v: Sequence[Scalar]) -> Iterate:
    """Where the solver starts: at the velocities of the step before.

    How hard contacts would push then is how hard they may rub in the first sweep.
    """
    u = terms.velocities(now.velocities(v), v)
    none = Values([[0.0] * 3 for _ in terms.contacts], [0.0] * len(terms.joints))
    limits = [c.friction * c.hinge.push(c.n.dot(Vec3.of(x))) for c, x in zip(terms.contacts, u.contacts, strict=True)]
    return Iterate(0.0, [v[s] for s in sweep.moving], u, none, limits, _FAR)


def solved(sweep: Sweep, terms: Terms, start: Iterate, mass: float, tolerance: Scalar) -> Iterate:
    """The solution, or the best that so many sweeps find.

    Args:
        sweep: the step's linear system.
        terms: what acts.
        start: where to start.
        mass: of the rig.
        tolerance: of the residual, √error [m/s].
    """
    if not (terms.contacts or terms.joints):
        return replace(start, error=0.0)

    def turn(at: Iterate) -> Iterate:
        bounded = at.k < BOUNDED
        full, off = _full_step(sweep, terms, at, where(bounded, 0.0, 1.0))
        if terms.contacts:
            full = replace(full, limits=_limits(terms, full, at))
        alpha, square = _searched(terms, at, full, off, where(bounded, 1.0, where(found(at), 1.0, 0.0)))
        left = 1.0 - alpha
        return replace(
            full,
            k=at.k + 1.0,
            v=[y - left * (y - x) for x, y in zip(at.v, full.v, strict=True)],
            u=at.u.moved(alpha, full.u),
            y=at.y.moved(alpha, full.y),
            error=square * (1.0 / mass),
        )

    def found(at: Iterate) -> Scalar:
        # what is not a number will not be one after more sweeps either
        return where(at.error >= tolerance * tolerance, 1.0, 0.0) < 0.5

    return repeat(MAX_SWEEPS, turn, replace(start, k=0.0, error=_FAR), found)


def _full_step(sweep: Sweep, terms: Terms, at: Iterate, theta: Scalar) -> tuple[Iterate, Values]:
    """Where a whole step leads, and g(u) − y where it starts."""
    load = Load.none()
    reactions = []
    for contact, u, limit in zip(terms.contacts, at.u.contacts, at.limits, strict=True):
        reactions.append(reaction := contact.reaction(Vec3.of(u), limit, theta))
        load.on_body(contact.body, *contact.act(reaction, Vec3.of(u)))
    answers = []
    for joint, u in zip(terms.joints, at.u.joints, strict=True):
        g, G = joint.reaction(u, theta)
        answers.append((g, G))
        load.on_joint(joint.direction, G, G * u - g)
    v, V = sweep.solve(load)
    u = terms.velocities(V, v)
    y = Values(
        [
            list(reaction.g + reaction.times(Vec3.of(new) - Vec3.of(old)))
            for reaction, new, old in zip(reactions, u.contacts, at.u.contacts, strict=True)
        ],
        [g + G * (new - old) for (g, G), new, old in zip(answers, u.joints, at.u.joints, strict=True)],
    )
    off = Values(
        [[g - f for g, f in zip(reaction.g, y, strict=True)] for reaction, y in zip(reactions, at.y.contacts, strict=True)],
        [g - f for (g, _), f in zip(answers, at.y.joints, strict=True)],
    )
    return replace(at, v=[v[s] for s in sweep.moving], u=u, y=y), off


def _limits(terms: Terms, new: Iterate, at: Iterate) -> list[Scalar]:
    """Friction times how hard contacts push, as long as sweeps bound its slope; then as it was."""
    limits = []
    for contact, u, y, limit in zip(terms.contacts, new.u.contacts, new.y.contacts, at.limits, strict=True):
        push = -contact.n.dot(Vec3.of(y))
        push = where(push > 0.0, push, contact.stopping(contact.n.dot(Vec3.of(u))))
        limits.append(where(at.k < BOUNDED, contact.friction * push, limit))
    return limits


@dataclass(frozen=True, eq=False)
class _Line:
    """A line search under way.

    Attributes:
        alpha, square: where it looked last, and Σ ‖g − y‖² there.
        following: where it looks next.
        low, high: φ' is negative there, and positive.
        done: 1 once the slope has all but gone.
    """

    alpha: Scalar
    square: Scalar
    following: Scalar
    low: Scalar
    high: Scalar
    done: Scalar


def _searched(terms: Terms, at: Iterate, full: Iterate, off: Values, settled: Scalar) -> tuple[Scalar, Scalar]:
    """How far to go, and Σ ‖g − y‖² there: all the way where that is settled or downhill enough, else to the bottom."""
    du = full.u.minus(at.u)
    off_end, square = terms.answers(full.u, full.y, full.limits)
    at_start, at_end = du.dot(off), du.dot(off_end)
    steep = absolute(at_start)
    done = where(settled > 0.5, 1.0, where(at_end <= _DOWNHILL * steep, 1.0, 0.0))
    secant = at_start / minimum(at_start - at_end, -1e-30)
    secant = minimum(maximum(secant, 0.0), 1.0)
    start = _Line(1.0, square, secant, 0.0, 1.0, done)

    def turn(line: _Line) -> _Line:
        alpha, dy = line.following, full.y.minus(at.y)
        u, y = at.u.moved(alpha, full.u), at.y.moved(alpha, full.y)
        off, square = terms.answers(u, y, full.limits)
        bends = terms.bends(u, du, full.limits)
        first, second = du.dot(off), sum((bend.second for bend in bends), 0.0) - du.dot(dy)
        low, high = where(first < 0.0, alpha, line.low), where(first < 0.0, line.high, alpha)
        newton, middle = alpha - first / maximum(second, 1e-30), 0.5 * (low + high)
        following = _before_turning(alpha, where((low < newton) & (newton < high), newton, middle), bends)
        return _Line(alpha, square, following, low, high, where(absolute(first) <= _FLAT * steep, 1.0, 0.0))

    def search(line: _Line) -> _Line:
        turning = _before_turning(1.0, 0.0, terms.bends(at.u.moved(line.alpha, full.u), du, full.limits))
        first = replace(line, following=where(turning > 0.0, turning, line.following))
        return repeat(_SEARCHES, turn, first, _is_done)

    line = repeat(1, search, start, _is_done)  # not at all, if no state needs it
    return line.alpha, line.square


def _is_done(line: _Line) -> Scalar:
    return line.done > 0.5


def _before_turning(alpha: Scalar, following: Scalar, bends: Sequence[Bend]) -> Scalar:
    """Where to look next: there, or at the strongest contact's point of least slip, if that lies on the way."""
    strongest: Scalar = 0.0
    low, high = minimum(alpha, following), maximum(alpha, following)
    for bend in bends:
        turning = alpha - bend.past
        nearer = (bend.pull > strongest) & (low < turning) & (turning < high)
        following, strongest = where(nearer, turning, following), where(nearer, bend.pull, strongest)
    return following
