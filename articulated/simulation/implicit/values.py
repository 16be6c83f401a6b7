"""All terms of a step, and what belongs to each: a velocity, an impulse."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from articulated.dynamics.mechanism import WORLD
from articulated.scalar import UNDEFINED, Scalar, each, fold, given
from articulated.simulation.implicit.terms import Contact, JointTerm
from articulated.spatial import Motion

Three = list[Scalar]
OfContact = Callable[..., list[Scalar]]
"""Takes a contact and what belongs to it of each of some lists."""


@dataclass(frozen=True, eq=False)
class Terms:
    """All terms of a step.

    What is computed of contacts with the ground is written out for each: much of it is constant. That of contacts between
    pieces is written once, as loops over pairs with as many contacts; of pairs that are not near it is skipped.

    Attributes:
        contacts: with the ground, then between pieces.
        joints: of joints, and ropes.
        met: how many of the last contacts each pair of pieces has.
        nearness: of each pair, 1 if any of them is near, else 0.
    """

    contacts: Sequence[Contact]
    joints: Sequence[JointTerm]
    met: Sequence[int] = ()
    nearness: Sequence[Scalar] = ()

    @property
    def grounded(self) -> int:
        """How many contacts are with the ground."""
        return len(self.contacts) - sum(self.met)

    @property
    def couplings(self) -> list[tuple[int, int]]:
        """Bodies between which contacts act."""
        return [ends for ends in self.ends if ends[1] != WORLD]

    @property
    def ends(self) -> list[tuple[int, int]]:
        """The bodies of each pair."""
        return [(self.contacts[of[0]].body, self.contacts[of[0]].other) for of in self._pairs()]

    def velocities(self, V: Sequence[Motion], v: Sequence[Scalar]) -> Values:
        """u."""
        own, other = self.motions(V)
        return Values(self.each(_relative, 3, own, other), [j.velocity(V, v) for j in self.joints])

    def motions(self, V: Sequence[Motion]) -> tuple[list[Motion], list[Motion]]:
        """Of each contact the velocities of its body and of the other one."""
        return [_motion(V, c.body) for c in self.contacts], [_motion(V, c.other) for c in self.contacts]

    def each(self, f: OfContact, n: int, *values: Sequence[Any]) -> list[list[Scalar]]:
        """n numbers of each contact, not defined if it is not near."""
        first = self.grounded
        ground = [f(c, *some) for c, *some in zip(self.contacts[:first], *(x[:first] for x in values), strict=True)]
        return [*ground, *self.of_met(f, n, *(x[first:] for x in values))]

    def near(self, f: OfContact, n: int, *values: Sequence[Any]) -> list[list[Scalar]]:
        """As `each`, and 0 of contacts with the ground that are not near."""
        first = self.grounded
        rows = zip(self.contacts[:first], *(x[:first] for x in values), strict=True)
        ground = [given(c.near, partial(f, c, *some), [0.0] * n) for c, *some in rows]
        return [*ground, *self.of_met(f, n, *(x[first:] for x in values))]

    def of_met(self, f: OfContact, n: int, *values: Sequence[Any], otherwise: float = UNDEFINED) -> list[list[Scalar]]:
        """As `each`, of contacts between pieces only; so are the values. Those that are not near have `otherwise`."""

        def of_pair(contacts: list[Contact], *some: Sequence[Any]) -> list[Scalar]:
            rows = zip(contacts, *some, strict=True)
            return [x for c, *own in rows for x in given(c.near, partial(f, c, *own), [otherwise] * n)]

        pairs = self._of_pairs(of_pair, n, values, 0, otherwise)
        return [pair[k : k + n] for pair in pairs for k in range(0, len(pair), n)]

    def of_pairs(self, f: OfContact, n: int, *values: Sequence[Any], otherwise: float = UNDEFINED) -> list[list[Scalar]]:
        """n numbers of each pair: sums over its contacts; the values are of contacts between pieces only."""

        def of_pair(contacts: list[Contact], *some: Sequence[Any]) -> list[Scalar]:
            total: list[Scalar] = [0.0] * n
            for c, *own in zip(contacts, *some, strict=True):
                total = given(c.near, partial(_more, total, partial(f, c, *own)), total)
            return total

        return self._of_pairs(of_pair, 0, values, n, otherwise)

    def near_joints(self, of_joint: Callable[[int], list[Scalar]], n: int) -> list[list[Scalar]]:
        """n numbers of each joint's term; zeros of those that are not near."""
        return [given(joint.near, partial(of_joint, k), [0.0] * n) for k, joint in enumerate(self.joints)]

    def total(self, contacts: Sequence[Sequence[Scalar]], joints: Sequence[Sequence[Scalar]], n: int) -> list[Scalar]:
        """Sums of n numbers that each term has, those that are not near none; `contacts` are as `each` gives them."""
        total, first = [0.0] * n, self.grounded
        for contact, numbers in zip(self.contacts[:first], contacts[:first], strict=True):
            total = given(contact.near, partial(_more, total, lambda numbers=numbers: numbers), total)
        for joint, numbers in zip(self.joints, joints, strict=True):
            total = given(joint.near, partial(_more, total, lambda numbers=numbers: numbers), total)
        return self.folded(lambda total, numbers: [a + b for a, b in zip(total, numbers, strict=True)], total, contacts[first:])

    def folded(self, f: Callable[[Any, Any], Any], carry: Any, numbers: Sequence[Sequence[Scalar]]) -> Any:
        """What `carry` becomes when f takes it together with the numbers of each contact between pieces that is near."""
        for some, rows in self._rows([numbers]):

            def body(carry: Any, row: list[Any]) -> Any:
                def all_of_it() -> Any:
                    result = carry
                    for (near, *_), own in zip(row[1], row[2], strict=True):
                        result = given(near > 0.5, partial(f, result, own), result)
                    return result

                return given(row[0] > 0.5, all_of_it, carry)

            carry = fold(rows, body, carry) if some else carry
        return carry

    def _pairs(self) -> Iterator[range]:
        """The contacts of each pair, by number."""
        at = self.grounded
        for count in self.met:
            yield range(at, at + count)
            at += count

    def _of_pairs(
        self, f: Callable[..., list[Scalar]], n: int, values: Sequence[Sequence[Any]], more: int, otherwise: float
    ) -> list[list[Scalar]]:
        """Of each pair n numbers for each of its contacts, and some more: a loop over all pairs that have as many."""
        results: dict[int, list[Scalar]] = {}
        for some, rows in self._rows(values):
            size = n * self.met[some[0]] + more

            def body(row: list[Any], size: int = size) -> list[Scalar]:
                contacts = [Contact.of(numbers) for numbers in row[1]]
                return given(row[0] > 0.5, partial(f, contacts, *row[2:]), [otherwise] * size)

            results.update(zip(some, each(rows, body), strict=True))
        return [results[k] for k in range(len(self.met))]

    def _rows(self, values: Sequence[Sequence[Any]]) -> Iterator[tuple[list[int], list[list[Any]]]]:
        """Pairs with as many contacts, by number, and a row for each: whether it is near, its contacts, and their values."""
        pairs, first = list(self._pairs()), self.grounded
        for count in sorted(set(self.met)):
            some = [k for k, size in enumerate(self.met) if size == count]
            rows = []
            for k in some:
                contacts = [self.contacts[i].numbers() for i in pairs[k]]
                rows.append([self.nearness[k], contacts, *([x[i - first] for i in pairs[k]] for x in values)])
            yield some, rows


@dataclass(frozen=True, eq=False)
class Values:
    """Velocities or impulses of all terms: of contacts in world axes, of joints along their directions."""

    contacts: list[Three]
    joints: list[Scalar]

    def moved(self, alpha: Scalar, to: Values) -> Values:
        """This part of the way to others; all of it is exactly these."""
        contacts = [between(alpha, a, b) for a, b in zip(self.contacts, to.contacts, strict=True)]
        return Values(contacts, between(alpha, self.joints, to.joints))

    def minus(self, other: Values) -> Values:
        return Values(
            [[x - y for x, y in zip(a, b, strict=True)] for a, b in zip(self.contacts, other.contacts, strict=True)],
            [x - y for x, y in zip(self.joints, other.joints, strict=True)],
        )


def between(alpha: Scalar, a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
    """This part of the way from some scalars to others; all of it is exactly these."""
    left = 1.0 - alpha
    return [y - left * (y - x) for x, y in zip(a, b, strict=True)]


def _relative(contact: Contact, own: Motion, other: Motion) -> list[Scalar]:
    return list(contact.velocity(own, other))


def _motion(V: Sequence[Motion], body: int) -> Motion:
    return Motion.zero() if body == WORLD else V[body]


def _more(total: Sequence[Scalar], numbers: Callable[[], Sequence[Scalar]]) -> list[Scalar]:
    return [a + b for a, b in zip(total, numbers(), strict=True)]
