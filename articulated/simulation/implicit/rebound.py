"""Restitution: a second solve after the first, in which what came together leaves again, Newton's law at each point.

The first solve gives v₁, as if nothing rebounded. In the second, contacts that pushed and had come faster than a threshold are
nearly rigid about the velocity −e u⁻; all others keep their laws. With several contacts, and with friction, Newton's law can
give more than came in (Kane 1984): of the way from v₁ to what the second solve finds only as much is taken as leaves no work
done by the contacts. Positions move with v₁ up to the part τ of the step at which the first of them meets, then with v⁺.

In free fall a step's velocity is that of its middle. So speeds of impact and rebound are looked at where they happen: the one
half a step and τ h after u⁻ was true, the other half a step and (1 − τ) h before u⁺ will be. So balls rise to e² of the height
that they fell from, however low that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from articulated.dynamics.sweep import Sweep
from articulated.scalar import Scalar, flatten, maximum, minimum, repeat, sqrt, where
from articulated.simulation.implicit.laws import Hinge
from articulated.simulation.implicit.newton import Iterate, solved
from articulated.simulation.implicit.values import Terms, Values
from articulated.spatial import Vec3

RIGID = 1e4
"""A contact that rebounds is so much harder than the mass that is felt."""
_NEVER = 2.0
SLOW = 0.01
"""What comes slower than this and two steps' fall stays [m/s, rad/s]."""


@dataclass(frozen=True, eq=False)
class Bounce:
    """What the two solves carry.

    Attributes:
        k: how many solves are done.
        hinges: of all contacts, then of all stops.
        found, first: what the last and the first solve found.
        meets: the part of the step after which the first contact meets that rebounds; more than 1 if none does.
        sweeps: of all solves.
    """

    k: Scalar
    hinges: list[Hinge]
    found: Iterate
    first: Iterate
    meets: Scalar
    sweeps: Scalar


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
    incoming = _incoming(terms, start.u, fall)

    def turn(at: Bounce) -> Bounce:
        acting = _with_hinges(terms, at.hinges)
        found = solved(sweep, acting, at.found, mass, tolerance, bend)
        hinges, meets = [], _NEVER
        for e, hinge, one, push in zip(restitutions, at.hinges, incoming, _pushes(acting, found), strict=True):
            leaves = (push > 0.0) & (one.speed + one.lag < -slow) & (e > 0.0)
            gap = -(hinge.a * h) / hinge.b
            tau = minimum(maximum(gap / where(leaves, -(one.speed + 2.0 * one.lag) * h, 1.0), 0.0), 1.0)
            target = (1.0 - 2.0 * tau) * one.lag - e * (one.speed + (1.0 + 2.0 * tau) * one.lag)
            hard = RIGID / one.w
            stiff = Hinge(hard * target, hard, 0.0)
            hinges.append(Hinge(*(where(leaves, x, y) for x, y in zip(flatten(stiff), flatten(hinge), strict=True))))
            meets = minimum(meets, where(leaves, tau, _NEVER))
        is_first = at.k < 0.5
        meets = where(is_first, meets, at.meets)
        return Bounce(at.k + 1.0, hinges, found, _chosen(is_first, found, at.first), meets, at.sweeps + found.k)

    begin = Bounce(0.0, _hinges(terms), start, start, 0.0, 0.0)
    end = repeat(2, turn, begin, lambda at: at.meets > 1.5)
    part = where(end.meets > 1.5, 0.0, _lossless(end, start.u, fall))
    found = replace(
        end.found,
        k=end.sweeps,
        v=_between(end.first.v, end.found.v, part),
        pulls=_between(end.first.pulls, end.found.pulls, part),
        u=end.first.u.moved(part, end.found.u),
        y=end.first.y.moved(part, end.found.y),
    )
    meets = minimum(end.meets, 1.0)
    moving = (_between(a, b, meets) for a, b in ((found.v, end.first.v), (found.pulls, end.first.pulls)))
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
        lag = contact.n.dot(fall)
        result.append(_Incoming(contact.n.dot(Vec3.of(x)), lag, contact.w))
    return result + [_Incoming(x * sign, 0.0, j.w) for j, x in zip(terms.joints, u.joints, strict=True) for sign, _ in j.stops]


def _hinges(terms: Terms) -> list[Hinge]:
    return [*(c.hinge for c in terms.contacts), *(hinge for j in terms.joints for _, hinge in j.stops)]


def _with_hinges(terms: Terms, hinges: Sequence[Hinge]) -> Terms:
    some = iter(hinges)
    contacts = [replace(contact, hinge=next(some)) for contact in terms.contacts]
    joints = [replace(joint, stops=tuple((sign, next(some)) for sign, _ in joint.stops)) for joint in terms.joints]
    return Terms(contacts, joints)


def _pushes(terms: Terms, found: Iterate) -> list[Scalar]:
    """How hard each hinge pushes."""
    pushes = [-contact.n.dot(Vec3.of(y)) for contact, y in zip(terms.contacts, found.y.contacts, strict=True)]
    for joint, u in zip(terms.joints, found.u.joints, strict=True):
        pushes += [hinge.push(u * sign) for sign, hinge in joint.stops]
    return pushes


def _lossless(end: Bounce, before: Values, fall: Vec3) -> Scalar:
    """The part of the way from the first solve to the second that the contacts need not do work for: 1 if all is."""
    zero, one, two = 0.0, 0.0, 0.0
    for y1, y2, u0, u1, u2 in zip(
        end.first.y.contacts, end.found.y.contacts, before.contacts, end.first.u.contacts, end.found.u.contacts, strict=True
    ):
        y, u = Vec3.of(y1), Vec3.of(u0) + Vec3.of(u1) + fall * 2.0
        dy, du = Vec3.of(y2) - y, Vec3.of(u2) - Vec3.of(u1)
        zero, one, two = zero + y.dot(u), one + dy.dot(u) + y.dot(du), two + dy.dot(du)
    root = sqrt(maximum(one * one - 4.0 * zero * two, 0.0))
    largest = (one + root) / maximum(-2.0 * two, 1e-30)
    return where(zero + one + two >= 0.0, 1.0, minimum(maximum(largest, 0.0), 1.0))


def _chosen(condition: Scalar, a: Iterate, b: Iterate) -> Iterate:
    def values(x: Values, y: Values) -> Values:
        contacts = [
            [where(condition, p, q) for p, q in zip(m, n, strict=True)] for m, n in zip(x.contacts, y.contacts, strict=True)
        ]
        return Values(contacts, [where(condition, p, q) for p, q in zip(x.joints, y.joints, strict=True)])

    v, pulls = ([where(condition, x, y) for x, y in zip(p, r, strict=True)] for p, r in ((a.v, b.v), (a.pulls, b.pulls)))
    return replace(a, v=v, pulls=pulls, u=values(a.u, b.u), y=values(a.y, b.y))
