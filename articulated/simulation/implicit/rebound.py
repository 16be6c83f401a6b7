"""Restitution: solves after the first, in which what came together leaves again, Newton's law at each point.

The first solve gives v₁, as if nothing rebounded. In the next, contacts that pushed and had come faster than a threshold are
nearly rigid about the velocity −e u⁻; others that have a restitution are open, all others keep their laws. If that lets more of
them come together, they leave in another pass, and so on: an impact goes from one body to the next, as through Newton's cradle.
What a pass gave stays given. In the last one nothing leaves, and all have their laws again.

With several contacts, and with friction, Newton's law can give more than came in (Kane 1984): of the way from v₁ to what the
last solve finds only as much is taken as leaves no work done by the contacts. Positions move with that mean of v₁ and v⁺ with
which the contact that meets first closes within the part τ of the step, and opens during the rest.

In free fall a step's velocity is that of its middle. So speeds of impact and rebound are looked at where they happen: the one
half a step and τ h after u⁻ was true, the other half a step and (1 − τ) h before u⁺ will be. So balls rise to e² of the height
that they fell from, however low that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.sweep import Sweep
from articulated.scalar import Scalar, either, maximum, minimum, repeat, sqrt, where
from articulated.simulation.implicit.iterate import Iterate
from articulated.simulation.implicit.laws import Hinge
from articulated.simulation.implicit.newton import solved
from articulated.simulation.implicit.terms import Contact
from articulated.simulation.implicit.values import Terms, Three, Values
from articulated.spatial import Vec3

RIGID = 1e6
"""A contact that rebounds is so much harder than the mass that is felt."""
_NEVER = 2.0
PASSES = 12
"""Solves of a step with impacts."""
_OPEN = Hinge(0.0, 1e-30, 0.0)
SLOW = 0.01
"""What comes slower than this and two steps' fall stays [m/s, rad/s]."""


@dataclass(frozen=True, eq=False)
class Bounce:
    """What the solves carry.

    Attributes:
        k: how many solves are done.
        hinges: of all contacts, then of all stops.
        leaving: of each of these 1 if it leaves in this pass.
        given: impulses of contacts and of joints' terms from passes before.
        found, first: what the last and the first solve found.
        meets: the part of the step after which the first contact meets that rebounds; more than 1 if none does.
        share: how much of the way from the first velocities to the last positions move with.
        sweeps: of all solves.
        last, done: 1 if all have their laws in the next solve, and once that is done.
    """

    k: Scalar
    hinges: list[Hinge]
    leaving: list[Scalar]
    given: Values
    found: Iterate
    first: Iterate
    meets: Scalar
    share: Scalar
    sweeps: Scalar
    last: Scalar
    done: Scalar


def rebounded(
    sweep: Sweep,
    terms: Terms,
    start: Iterate,
    restitutions: Sequence[Scalar],
    gravity: Vec3,
    mass: float,
    tolerance: Scalar,
    h: Scalar,
    bend: Sequence[Scalar] = (),
) -> tuple[Iterate, Iterate]:
    """What the step ends with, and the same with the velocities and pulls that move positions.

    Args:
        sweep, terms, start, mass, tolerance, bend: as of `newton.solved`.
        restitutions: of each hinge: contacts', then stops'.
        gravity: acceleration of free fall.
        h: length of the step.
    """
    fall = gravity * (0.5 * h)
    slow = SLOW + 4.0 * sqrt(fall.dot(fall))
    incoming, laws = _incoming(terms, start.u, fall), _hinges(terms)

    def turn(at: Bounce) -> Bounce:
        found = solved(sweep, _with(terms, at.hinges, at.given), at.found, mass, tolerance, bend)
        is_first = at.k < 0.5
        meets, share, leaving, stiff = _NEVER, 0.0, [], []
        for e, hinge, before, now, near in zip(
            restitutions, laws, incoming, _speeds(terms, found.u), _near(terms), strict=True
        ):
            speed, lag = where(is_first, before.speed, now), where(is_first, before.lag, 0.0)
            pushes = (hinge.push(now) > 0.0) & near
            leaves = pushes & (speed + lag < -slow) & (e > 0.0) & (at.last < 0.5)
            gap = -(hinge.a * h) / hinge.b
            tau = minimum(maximum(gap / where(leaves, -(speed + 2.0 * lag) * h, 1.0), 0.0), 1.0)
            target = where(is_first, (1.0 - 2.0 * tau) * lag - e * (speed + (1.0 + 2.0 * tau) * lag), -(e * speed))
            hard = RIGID / before.w
            stiff.append(Hinge(hard * target, hard, 0.0))
            leaving.append(where(leaves, 1.0, 0.0))
            meets = minimum(meets, where(leaves, tau, _NEVER))
            moved = (1.0 - tau) * (target + tau * lag) - gap / h - now
            share = maximum(share, where(leaves, moved / where(leaves, target - now, 1.0), 0.0))
        is_last = meets > 1.5
        hinges = []
        for e, hinge, hard, leaves in zip(restitutions, laws, stiff, leaving, strict=True):
            rests = either(e > 0.0, _OPEN, hinge)
            hinges.append(either(is_last, hinge, either(leaves > 0.5, hard, rests)))
        return Bounce(
            at.k + 1.0,
            hinges,
            leaving,
            _given(terms, at, found),
            found,
            either(is_first, found, at.first),
            where(is_first, meets, at.meets),
            where(is_first, share, at.share),
            at.sweeps + found.k,
            where(is_last, 1.0, 0.0),
            where(is_last & is_first, 1.0, at.last),
        )

    nothing = Values([[0.0] * 3 for _ in terms.contacts], [0.0] * len(terms.joints))
    begin = Bounce(0.0, laws, [0.0] * len(laws), nothing, start, start, 0.0, 0.0, 0.0, 0.0, 0.0)
    end = repeat(PASSES, turn, begin, lambda at: at.done > 0.5)
    part = where(end.meets > 1.5, 0.0, _lossless(terms, end, start.u, fall * (4.0 * end.meets)))
    found = replace(
        end.found,
        k=end.sweeps,
        v=_between(end.first.v, end.found.v, part),
        pulls=_between(end.first.pulls, end.found.pulls, part),
        u=end.first.u.moved(part, end.found.u),
        y=end.first.y.moved(part, end.found.y),
    )
    share = where(end.meets > 1.5, 1.0, minimum(end.share, 1.0))
    moving = (_between(a, b, share) for a, b in ((end.first.v, found.v), (end.first.pulls, found.pulls)))
    return found, replace(found, **dict(zip(("v", "pulls"), moving, strict=True)))


def _between(a: Sequence[Scalar], b: Sequence[Scalar], part: Scalar) -> list[Scalar]:
    return [x + part * (y - x) for x, y in zip(a, b, strict=True)]


@dataclass(frozen=True)
class _Incoming:
    """How a hinge is being met: the speed along it, what half a step's fall adds, and how much velocity an impulse gives."""

    speed: Scalar
    lag: Scalar
    w: float


def _incoming(terms: Terms, u: Values, fall: Vec3) -> list[_Incoming]:
    result = []
    for contact, x in zip(terms.contacts, u.contacts, strict=True):
        lag = contact.n.dot(fall) if contact.other == WORLD else 0.0  # both fall
        result.append(_Incoming(contact.n.dot(Vec3.of(x)), lag, contact.w))
    return result + [_Incoming(x * sign, 0.0, j.w) for j, x in zip(terms.joints, u.joints, strict=True) for sign, _ in j.stops]


def _hinges(terms: Terms) -> list[Hinge]:
    return [*(c.hinge for c in terms.contacts), *(hinge for j in terms.joints for _, hinge in j.stops)]


def _with(terms: Terms, hinges: Sequence[Hinge], given: Values) -> Terms:
    """The terms with other hinges, and with impulses that they give already."""
    some = iter(hinges)
    contacts = [
        replace(contact, hinge=next(some), already=Vec3.of(x))
        for contact, x in zip(terms.contacts, given.contacts, strict=True)
    ]
    joints = [
        replace(joint, stops=tuple((sign, next(some)) for sign, _ in joint.stops), already=x)
        for joint, x in zip(terms.joints, given.joints, strict=True)
    ]
    return Terms(contacts, joints, terms.met, terms.nearness)


def _given(terms: Terms, at: Bounce, found: Iterate) -> Values:
    """What has been given by now: by what left in this pass, all that it gave."""
    leaving = iter(at.leaving)
    contacts, joints = [], []
    for y, old in zip(found.y.contacts, at.given.contacts, strict=True):
        left = next(leaving) > 0.5
        contacts.append([where(left, -a, b) for a, b in zip(y, old, strict=True)])
    for joint, y, old in zip(terms.joints, found.y.joints, at.given.joints, strict=True):
        for _ in joint.stops:
            old = where(next(leaving) > 0.5, -y, old)
        joints.append(old)
    return Values(contacts, joints)


def _near(terms: Terms) -> list[Scalar]:
    """Whether what each hinge belongs to is near; of others nothing is defined."""
    return [*(contact.near for contact in terms.contacts), *(True for joint in terms.joints for _ in joint.stops)]


def _speeds(terms: Terms, u: Values) -> list[Scalar]:
    """Along each hinge."""
    speeds = [contact.n.dot(Vec3.of(x)) for contact, x in zip(terms.contacts, u.contacts, strict=True)]
    return speeds + [x * sign for joint, x in zip(terms.joints, u.joints, strict=True) for sign, _ in joint.stops]


def _lossless(terms: Terms, end: Bounce, before: Values, fall: Vec3) -> Scalar:
    """The part of the way from the first solve to the last that the contacts need not do work for: 1 if all is.

    `fall` takes a velocity before the step, and one of the middle of the step, to where both are true.
    """

    def of_contact(_: Contact, y1: Three, y2: Three, before: Three, u1: Three, u2: Three) -> list[Scalar]:
        y, u = Vec3.of(y1), Vec3.of(before) + Vec3.of(u1)
        dy, du = Vec3.of(y2) - y, Vec3.of(u2) - Vec3.of(u1)
        return [y.dot(u), dy.dot(u) + y.dot(du), dy.dot(du)]

    at = terms.grounded
    started = [*([x + f for x, f in zip(u, fall, strict=True)] for u in before.contacts[:at]), *before.contacts[at:]]
    values = end.first.y.contacts, end.found.y.contacts, started, end.first.u.contacts, end.found.u.contacts
    zero, one, two = terms.total(terms.each(of_contact, 3, *values), [[0.0] * 3 for _ in terms.joints], 3)
    root = sqrt(maximum(one * one - 4.0 * zero * two, 0.0))
    largest = (one + root) / maximum(-2.0 * two, 1e-30)
    return where(zero + one + two >= 0.0, 1.0, minimum(maximum(largest, 0.0), 1.0))
