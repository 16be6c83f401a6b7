"""Contacts between pieces of bodies, and of these with what stands around: where they are, and by which laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import Tree
from articulated.scalar import UNDEFINED, Scalar, given, maximum, sqrt
from articulated.simulation.contact.meeting import each_pair, meet, within
from articulated.simulation.contact.narrow.placed import Placed, Touch
from articulated.simulation.contact.pieces import Piece
from articulated.simulation.implicit.momentum import Past
from articulated.simulation.implicit.problem import ANCHORING, FASTEST_SAG, REACH, hinge
from articulated.simulation.implicit.stance import Stance
from articulated.simulation.implicit.terms import Contact
from articulated.simulation.scene import Numbers, Scene
from articulated.spatial import Mat3, Motion, Vec3


def meetings(
    scene: Scene, now: Tree, past: Past, V: Sequence[Motion], stance: Stance, numbers: Numbers, h: Scalar
) -> tuple[list[Contact], list[Scalar]]:
    """Of all points where pieces may touch each other, open ones too: a step may close them. And whether each pair is near.

    V are the velocities that bodies have.
    """
    sides, materials, grips, felt, first = [], [], [], [], 0
    for pair in scene.pairs:
        bodies = zip((pair.a, pair.b), scene.ends(pair), strict=True)
        sides.append([_Side.of(scene.pieces[k], now, past, V, body) for k, body in bodies])
        material = numbers.materials[pair.material]
        materials.append([material.friction, material.stiffness, material.dissipation])
        grips.append(stance.grips[first : first + scene.points_of(pair)])
        felt.append(scene.felt(scene.touches + first))
        first += scene.points_of(pair)

    def of_pair(
        a: Placed, b: Placed, sides: Sequence[_Side], material: Sequence[Scalar], w: Scalar, grips: Sequence
    ) -> list[Scalar]:
        own, other = sides
        reach = own.reach + other.reach + h * (REACH + own.fastest(a.center, other, b.center))

        def near() -> list[Scalar]:
            touches = zip(meet(a, b), grips, strict=True)
            some = [_contact(touch, own, other, material, w, Vec3.of(grip), past.h, h).numbers() for touch, grip in touches]
            nearest = some[0][0]
            for numbers in some[1:]:
                nearest = maximum(nearest, numbers[0])
            return [nearest, *(x for numbers in some for x in numbers)]

        nothing = [0.0, *[UNDEFINED] * (Contact.SIZE - 1)]
        return given(within(a, b, reach), near, [0.0, *nothing * len(grips)])

    found = each_pair(now, scene.pieces, scene.pairs, of_pair, sides, materials, felt, grips)
    contacts = []
    for (_, *some), pair in zip(found, scene.pairs, strict=True):
        body, other = scene.ends(pair)
        for k in range(0, len(some), Contact.SIZE):
            contacts.append(replace(Contact.of(some[k : k + Contact.SIZE]), body=body, other=other))
    return contacts, [nearest for nearest, *_ in found]


@dataclass(frozen=True, eq=False)
class _Side:
    """One of two pieces, and how its body moves.

    Attributes:
        reach, round: of the piece.
        spin: how fast its surface may be besides what its middle is [m/s].
        V: velocity of its body.
        R: axes of its body.
        D, c: in the step before, a point that is now at x strayed by D x + c from a straight way.
    """

    reach: Scalar
    round: Scalar
    spin: Scalar
    V: Motion
    R: Mat3
    D: Mat3
    c: Vec3

    @staticmethod
    def of(piece: Piece, now: Tree, past: Past, V: Sequence[Motion], body: int) -> _Side:
        if body == WORLD:
            return _Side(piece.reach, piece.round, 0.0, Motion.zero(), Mat3.identity(), Mat3.zero(), Vec3.zero())
        omega = V[body].angular
        spin = sqrt(omega.dot(omega)) * piece.reach
        return _Side(piece.reach, piece.round, spin, V[body], Mat3.identity() @ now.X[body].R, *past.straying(now, body))

    def fastest(self, middle: Vec3, other: _Side, its: Vec3) -> Scalar:
        """The largest speed between two points of both, with these middles."""
        own, its = (side.V.linear + side.V.angular.cross(x) for side, x in ((self, middle), (other, its)))
        apart = own - its
        return sqrt(apart.dot(apart)) + self.spin + other.spin

    def strayed(self, x: Vec3) -> Vec3:
        """See the attributes."""
        return self.D @ x + self.c


def _contact(
    touch: Touch, own: _Side, other: _Side, material: Sequence[Scalar], w: Scalar, grip: Vec3, before: Scalar, h: Scalar
) -> Contact:
    """The contact at a point; `before` is the length of the step before."""
    n, (friction, stiffness, dissipation) = touch.normal, material
    # points in the middle of what is round, and on the surface of what is not
    ends = (touch.point + n * (sign * (0.5 * touch.size + side.round)) for side, sign in ((own, 1.0), (other, -1.0)))
    strayed = [side.strayed(end) for side, end in zip((own, other), ends, strict=True)]
    sag = maximum(n.dot(strayed[0] - strayed[1]), -(FASTEST_SAG * before))
    along = other.R @ grip
    anchor = (along - n * n.dot(along)) * (ANCHORING / h)
    law = hinge(touch.size, stiffness, dissipation, w, h, sag)
    contact = Contact(WORLD, touch.point, n, law, anchor, Vec3.zero(), friction, w, near=True)
    return replace(contact, near=touch.size + h * (n.dot(contact.velocity(own.V, other.V)) - REACH) < 0.0)
