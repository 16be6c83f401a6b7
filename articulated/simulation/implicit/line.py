"""How far to go along a step of Newton's method: to the bottom of what is minimised between its start and its end.

The slope there is known from the terms alone: φ'(α) = Σ (g(u + α δu) − y − α δy) · δu, less δv · (r + α δr) if the linear
system was left unsolved by some r.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from articulated.scalar import Scalar, absolute, given, maximum, minimum, repeat, where
from articulated.simulation.implicit.laws import dot
from articulated.simulation.implicit.terms import Contact
from articulated.simulation.implicit.values import Terms, Three, Values, between
from articulated.spatial import Vec3

_SEARCHES = 6
_DOWNHILL, _FLAT = 0.5, 0.01
"""A step is taken whole if the slope at its end is at most the first part of that at its beginning; else only so far that it is
the second. Short steps must be good ones, or sliding contacts take turns for ever.
"""


@dataclass(frozen=True, eq=False)
class Way:
    """A whole step.

    Attributes:
        terms: what acts.
        limits: of the contacts' friction cones.
        u, y: velocities and impulses of the terms where it starts.
        g: impulses that they answer there.
        u_end, y_end: where it ends.
        unsolved: δv · r where it starts and where it ends, with r what is left of the linear system.
    """

    terms: Terms
    limits: Sequence[Scalar]
    u: Values
    y: Values
    g: Values
    u_end: Values
    y_end: Values
    unsolved: tuple[Scalar, Scalar]

    def place(self, alpha: Scalar) -> tuple[Values, Values, list[Scalar]]:
        """u and y this part of the way, and the limits; 0 of terms that are not near."""

        def contact(_: Contact, u: Three, u_end: Three, y: Three, y_end: Three, limit: Scalar) -> list[Scalar]:
            return [*between(alpha, u, u_end), *between(alpha, y, y_end), limit]

        def joint(k: int) -> list[Scalar]:
            return between(alpha, [self.u.joints[k], self.y.joints[k]], [self.u_end.joints[k], self.y_end.joints[k]])

        ends = self.u.contacts, self.u_end.contacts, self.y.contacts, self.y_end.contacts
        contacts, joints = self.terms.near(contact, 7, *ends, self.limits), self.terms.near_joints(joint, 2)
        u = Values([x[:3] for x in contacts], [x for x, _ in joints])
        return u, Values([x[3:6] for x in contacts], [x for _, x in joints]), [x[6] for x in contacts]

    def searched(self, settled: Scalar) -> tuple[Scalar, Scalar]:
        """How far to go, and Σ ‖g − y‖² there: all the way where that is settled or downhill enough, else to the bottom."""
        some = self.u.contacts, self.u_end.contacts, self.y_end.contacts, self.limits, self.g.contacts, self.y.contacts
        contacts, joints = self.terms.each(_at_ends, 3, *some), [self._joint_at_ends(n) for n in range(len(self.u.joints))]
        at_start, at_end, square = self.terms.total(contacts, joints, 3)
        left, change = self.unsolved[0], self.unsolved[1] - self.unsolved[0]
        at_start, at_end = at_start - left, at_end - self.unsolved[1]
        steep = absolute(at_start)
        done = where(settled > 0.5, 1.0, where(at_end <= _DOWNHILL * steep, 1.0, 0.0))
        secant = at_start / minimum(at_start - at_end, -1e-30)
        start = _Place(1.0, square, minimum(maximum(secant, 0.0), 1.0), 0.0, 1.0, done)

        def turn(line: _Place) -> _Place:
            alpha = line.following
            contacts, joints = self._at(alpha)
            first, square, second = self.terms.total([x[:3] for x in contacts], [x[:3] for x in joints], 3)
            first, second = first - (left + alpha * change), second - change
            low, high = where(first < 0.0, alpha, line.low), where(first < 0.0, line.high, alpha)
            newton, middle = alpha - first / maximum(second, 1e-30), 0.5 * (low + high)
            following = where((low < newton) & (newton < high), newton, middle)
            following = self._before_turning(alpha, following, [x[3:] for x in (*contacts, *joints)])
            return _Place(alpha, square, following, low, high, where(absolute(first) <= _FLAT * steep, 1.0, 0.0))

        def search(line: _Place) -> _Place:
            contacts, joints = self._at(line.alpha)
            turning = self._before_turning(1.0, 0.0, [x[3:] for x in (*contacts, *joints)])
            first = replace(line, following=where(turning > 0.0, turning, line.following))
            return repeat(_SEARCHES, turn, first, _is_done)

        line = repeat(1, search, start, _is_done)  # not at all, if no state needs it
        return line.alpha, line.square

    def _joint_at_ends(self, n: int) -> list[Scalar]:
        off, square = self.terms.joints[n].answer(self.u_end.joints[n], self.y_end.joints[n])
        du = self.u_end.joints[n] - self.u.joints[n]
        return [du * (self.g.joints[n] - self.y.joints[n]), du * off, square]

    def _at(self, alpha: Scalar) -> tuple[list[list[Scalar]], list[list[Scalar]]]:
        """What terms tell this part of the way: φ', Σ ‖g − y‖², φ'', the point of least slip, and friction's pull, squared."""

        def contact(c: Contact, u: Sequence[Three], y: Sequence[Three], limit: Scalar) -> list[Scalar]:
            (start, end), (y_start, y_end) = u, y
            du, dy = ([b - a for a, b in zip(*ends, strict=True)] for ends in (u, y))
            here = Vec3.of(between(alpha, start, end))
            off, square = c.answer(here, Vec3.of(between(alpha, y_start, y_end)), limit)
            bend = c.bend(here, Vec3.of(du), limit)
            return [dot(du, list(off)), square, bend.second - dot(du, dy), bend.past, bend.pull]

        def joint(k: int) -> list[Scalar]:
            u, y = between(alpha, [self.u.joints[k], self.y.joints[k]], [self.u_end.joints[k], self.y_end.joints[k]])
            term, du, dy = (
                self.terms.joints[k],
                self.u_end.joints[k] - self.u.joints[k],
                self.y_end.joints[k] - self.y.joints[k],
            )
            off, square = term.answer(u, y)
            bend = term.bend(u, du)
            return [du * off, square, bend.second - du * dy, bend.past, bend.pull]

        u = list(zip(self.u.contacts, self.u_end.contacts, strict=True))
        y = list(zip(self.y.contacts, self.y_end.contacts, strict=True))
        contacts = self.terms.each(contact, 5, u, y, self.limits)
        return contacts, [joint(k) for k in range(len(self.terms.joints))]

    def _before_turning(self, alpha: Scalar, following: Scalar, bends: Sequence[Sequence[Scalar]]) -> Scalar:
        """Where to look next: there, or at the strongest term's point of least slip, if that lies on the way."""
        low, high, first = minimum(alpha, following), maximum(alpha, following), self.terms.grounded

        def nearer(bend: Sequence[Scalar], found: Sequence[Scalar]) -> list[Scalar]:
            (past, pull), (following, strongest) = bend, found
            turning = alpha - past
            is_nearer = (pull > strongest) & (low < turning) & (turning < high)
            return [where(is_nearer, turning, following), where(is_nearer, pull, strongest)]

        found, end = [following, 0.0], len(self.terms.contacts)
        terms = [*self.terms.contacts[:first], *self.terms.joints]
        for term, bend in zip(terms, [*bends[:first], *bends[end:]], strict=True):
            found = given(term.near, partial(nearer, bend, found), found)
        return self.terms.folded(lambda found, bend: nearer(bend, found), found, bends[first:end])[0]


def _at_ends(c: Contact, u: Three, u_end: Three, y_end: Three, limit: Scalar, g: Three, y: Three) -> list[Scalar]:
    off, square = c.answer(Vec3.of(u_end), Vec3.of(y_end), limit)
    du = [b - a for a, b in zip(u, u_end, strict=True)]
    return [dot(du, [a - b for a, b in zip(g, y, strict=True)]), dot(du, list(off)), square]


@dataclass(frozen=True, eq=False)
class _Place:
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


def _is_done(line: _Place) -> Scalar:
    return line.done > 0.5
