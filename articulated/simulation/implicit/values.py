"""All terms of a step, and what belongs to each: a velocity, an impulse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from articulated.scalar import Scalar, given
from articulated.simulation.implicit.terms import Contact, JointTerm
from articulated.spatial import Motion

Three = list[Scalar]


@dataclass(frozen=True, eq=False)
class Terms:
    """All terms of a step."""

    contacts: Sequence[Contact]
    joints: Sequence[JointTerm]

    def velocities(self, V: Sequence[Motion], v: Sequence[Scalar]) -> Values:
        """u."""
        return Values([list(c.velocity(V)) for c in self.contacts], [j.velocity(V, v) for j in self.joints])

    def near(self, of_contact: Callable[[int], list[Scalar]], n: int) -> list[list[Scalar]]:
        """n numbers of each contact; zeros of those that are not near."""
        return [given(contact.near, partial(of_contact, k), [0.0] * n) for k, contact in enumerate(self.contacts)]

    def near_joints(self, of_joint: Callable[[int], list[Scalar]], n: int) -> list[list[Scalar]]:
        """As `near`, of each joint's term."""
        return [given(joint.near, partial(of_joint, k), [0.0] * n) for k, joint in enumerate(self.joints)]

    def total(
        self, of_contact: Callable[[int], Sequence[Scalar]], of_joint: Callable[[int], Sequence[Scalar]], n: int
    ) -> list[Scalar]:
        """Sums of n numbers that each term tells; terms that are not near tell none."""
        total: list[Scalar] = [0.0] * n
        for k, contact in enumerate(self.contacts):
            total = given(contact.near, partial(_with, total, of_contact, k), total)
        for k, joint in enumerate(self.joints):
            total = given(joint.near, partial(_with, total, of_joint, k), total)
        return total


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


def _with(total: Sequence[Scalar], of: Callable[[int], Sequence[Scalar]], k: int) -> list[Scalar]:
    return [a + b for a, b in zip(total, of(k), strict=True)]
