"""What terms answer near some velocities u, to first order: y = g + G (u′ − u)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from articulated.dynamics.folded import Load
from articulated.dynamics.mechanism import WORLD
from articulated.scalar import Scalar, given
from articulated.simulation.implicit.terms import Contact, Reaction
from articulated.simulation.implicit.values import Terms, Values
from articulated.spatial import ArticulatedInertia, Force, Vec3

_BODY = 27
"""Numbers of an inertia and a bias."""


@dataclass(frozen=True, eq=False)
class Linear:
    """See above.

    Attributes:
        terms: which.
        u: their velocities.
        g: their answers there.
        reactions, slopes: of contacts their reactions, as numbers; and G of joints' terms.
    """

    terms: Terms
    u: Values
    g: Values
    reactions: list[list[Scalar]]
    slopes: list[Scalar]

    @staticmethod
    def of(terms: Terms, u: Values, limits: Sequence[Scalar], theta: Scalar) -> Linear:
        """Near u; `limits` are of friction cones, `theta` as of `laws`."""

        def reaction(contact: Contact, u: Sequence[Scalar], limit: Scalar) -> list[Scalar]:
            return contact.reaction(Vec3.of(u), limit, theta).numbers()

        reactions = terms.each(reaction, Reaction.SIZE, u.contacts, limits)
        answers = [joint.reaction(x, theta) for joint, x in zip(terms.joints, u.joints, strict=True)]
        g = Values([numbers[:3] for numbers in reactions], [answer for answer, _ in answers])
        return Linear(terms, u, g, reactions, [slope for _, slope in answers])

    def add(self, load: Load, pairs: bool) -> Load:
        """Add these terms to a load; those between two bodies only if `pairs`."""
        terms, first = self.terms, self.terms.grounded
        some = zip(terms.contacts[:first], self.reactions[:first], self.u.contacts[:first], strict=True)
        for contact, numbers, x in some:
            reaction = Reaction.of(numbers, contact.n)
            load.on_body(contact.body, contact.near, *contact.act(reaction, Vec3.of(x)))
        for (body, other), near, numbers in zip(terms.ends, terms.nearness, self._of_pairs(), strict=True):
            acts, inertia, bias = near > 0.5, ArticulatedInertia.of(numbers[:21]), Force.of(numbers[21:])
            if other == WORLD:
                load.on_body(body, acts, inertia, bias)
            elif pairs:
                load.on_pair(body, other, acts, inertia, bias)
        for joint, u, answer, G in zip(terms.joints, self.u.joints, self.g.joints, self.slopes, strict=True):
            if joint.rope is not None:
                load.on_line(joint.rope[0], *_linear(answer, G, u))
            else:
                load.on_joint(joint.direction, *given(joint.near, partial(_linear, answer, G, u), [0.0, 0.0]))
        return load

    def answer(self, u: Values) -> Values:
        """y at other velocities."""

        def of(contact: Contact, numbers: Sequence[Scalar], new: Sequence[Scalar], old: Sequence[Scalar]) -> list[Scalar]:
            reaction = Reaction.of(numbers, contact.n)
            return list(reaction.g + reaction.times(Vec3.of(new) - Vec3.of(old)))

        joints = zip(self.g.joints, self.slopes, u.joints, self.u.joints, strict=True)
        contacts = self.terms.each(of, 3, self.reactions, u.contacts, self.u.contacts)
        return Values(contacts, [g + G * (new - old) for g, G, new, old in joints])

    def _of_pairs(self) -> list[list[Scalar]]:
        """Of each pair what it adds to the inertia and the bias of a body."""
        first = self.terms.grounded

        def act(contact: Contact, numbers: Sequence[Scalar], u: Sequence[Scalar]) -> list[Scalar]:
            inertia, bias = contact.act(Reaction.of(numbers, contact.n), Vec3.of(u))
            return [*inertia, *bias]

        return self.terms.of_pairs(act, _BODY, self.reactions[first:], self.u.contacts[first:])


def _linear(answer: Scalar, G: Scalar, u: Scalar) -> list[Scalar]:
    """The mass and the momentum that act along a joint."""
    return [G, G * u - answer]
