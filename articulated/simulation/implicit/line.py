"""How far to go along a step of Newton's method: to the bottom of what is minimised between its start and its end.

The slope there is known from the terms alone: φ'(α) = Σ (g(u + α δu) − y − α δy) · δu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from articulated.scalar import Scalar, absolute, given, maximum, minimum, repeat, where
from articulated.simulation.implicit.laws import dot
from articulated.simulation.implicit.terms import Bend
from articulated.simulation.implicit.values import Terms, Values, between
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
        du, dy: from start to end.
    """

    terms: Terms
    limits: Sequence[Scalar]
    u: Values
    y: Values
    g: Values
    u_end: Values
    y_end: Values
    du: Values
    dy: Values

    def place(self, alpha: Scalar) -> tuple[Values, Values, list[Scalar]]:
        """u and y this part of the way, and the limits; 0 of terms that are not near."""

        def contact(k: int) -> list[Scalar]:
            u = between(alpha, self.u.contacts[k], self.u_end.contacts[k])
            return [*u, *between(alpha, self.y.contacts[k], self.y_end.contacts[k]), self.limits[k]]

        def joint(k: int) -> list[Scalar]:
            return between(alpha, [self.u.joints[k], self.y.joints[k]], [self.u_end.joints[k], self.y_end.joints[k]])

        contacts, joints = self.terms.near(contact, 7), self.terms.near_joints(joint, 2)
        u = Values([x[:3] for x in contacts], [x for x, _ in joints])
        return u, Values([x[3:6] for x in contacts], [x for _, x in joints]), [x[6] for x in contacts]

    def searched(self, settled: Scalar) -> tuple[Scalar, Scalar]:
        """How far to go, and Σ ‖g − y‖² there: all the way where that is settled or downhill enough, else to the bottom."""
        at_start, at_end, square = self.terms.total(self._contact_at_ends, self._joint_at_ends, 3)
        steep = absolute(at_start)
        done = where(settled > 0.5, 1.0, where(at_end <= _DOWNHILL * steep, 1.0, 0.0))
        secant = at_start / minimum(at_start - at_end, -1e-30)
        start = _Place(1.0, square, minimum(maximum(secant, 0.0), 1.0), 0.0, 1.0, done)

        def turn(line: _Place) -> _Place:
            alpha = line.following
            u, y = self.u.moved(alpha, self.u_end), self.y.moved(alpha, self.y_end)
            bends = self._bends(u)
            first, square, second = self.terms.total(partial(self._contact, u, y, bends), partial(self._joint, u, y, bends), 3)
            low, high = where(first < 0.0, alpha, line.low), where(first < 0.0, line.high, alpha)
            newton, middle = alpha - first / maximum(second, 1e-30), 0.5 * (low + high)
            following = where((low < newton) & (newton < high), newton, middle)
            following = self._before_turning(alpha, following, bends)
            return _Place(alpha, square, following, low, high, where(absolute(first) <= _FLAT * steep, 1.0, 0.0))

        def search(line: _Place) -> _Place:
            turning = self._before_turning(1.0, 0.0, self._bends(self.u.moved(line.alpha, self.u_end)))
            first = replace(line, following=where(turning > 0.0, turning, line.following))
            return repeat(_SEARCHES, turn, first, _is_done)

        line = repeat(1, search, start, _is_done)  # not at all, if no state needs it
        return line.alpha, line.square

    def _contact_at_ends(self, n: int) -> list[Scalar]:
        du, contact = self.du.contacts[n], self.terms.contacts[n]
        off, square = contact.answer(Vec3.of(self.u_end.contacts[n]), Vec3.of(self.y_end.contacts[n]), self.limits[n])
        start = [g - f for g, f in zip(self.g.contacts[n], self.y.contacts[n], strict=True)]
        return [dot(du, start), dot(du, list(off)), square]

    def _joint_at_ends(self, n: int) -> list[Scalar]:
        off, square = self.terms.joints[n].answer(self.u_end.joints[n], self.y_end.joints[n])
        du = self.du.joints[n]
        return [du * (self.g.joints[n] - self.y.joints[n]), du * off, square]

    def _contact(self, u: Values, y: Values, bends: Sequence[Bend], n: int) -> list[Scalar]:
        off, square = self.terms.contacts[n].answer(Vec3.of(u.contacts[n]), Vec3.of(y.contacts[n]), self.limits[n])
        du = self.du.contacts[n]
        return [dot(du, list(off)), square, bends[n].second - dot(du, self.dy.contacts[n])]

    def _joint(self, u: Values, y: Values, bends: Sequence[Bend], n: int) -> list[Scalar]:
        off, square = self.terms.joints[n].answer(u.joints[n], y.joints[n])
        du = self.du.joints[n]
        return [du * off, square, bends[len(self.terms.contacts) + n].second - du * self.dy.joints[n]]

    def _bends(self, u: Values) -> list[Bend]:
        contacts = zip(self.terms.contacts, u.contacts, self.du.contacts, self.limits, strict=True)
        joints = zip(self.terms.joints, u.joints, self.du.joints, strict=True)
        bends = [contact.bend(Vec3.of(x), Vec3.of(dx), limit) for contact, x, dx, limit in contacts]
        return [*bends, *(joint.bend(x, dx) for joint, x, dx in joints)]

    def _before_turning(self, alpha: Scalar, following: Scalar, bends: Sequence[Bend]) -> Scalar:
        """Where to look next: there, or at the strongest term's point of least slip, if that lies on the way."""
        low, high = minimum(alpha, following), maximum(alpha, following)

        def nearer(bend: Bend, found: Sequence[Scalar]) -> list[Scalar]:
            following, strongest = found
            turning = alpha - bend.past
            is_nearer = (bend.pull > strongest) & (low < turning) & (turning < high)
            return [where(is_nearer, turning, following), where(is_nearer, bend.pull, strongest)]

        found = [following, 0.0]
        for term, bend in zip([*self.terms.contacts, *self.terms.joints], bends, strict=True):
            found = given(term.near, partial(nearer, bend, found), found)
        return found[0]


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
