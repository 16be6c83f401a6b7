"""Two boxes where a face of one looks at a face of the other: up to four points.

The face of the other box is clipped to what is over the first: Sutherland and Hodgman, Reentrant Polygon Clipping (1974).
Differs: what is left is never written down as a polygon. Only extreme points of it are sought, among the ends of the clipped
edges and the corners of the first face that lie under the other: the lowest, the one opposite, and on either side of the line
between these the one that is farthest from it; if one side is empty, the one that is farthest from the triangle.

symbol     meaning
n, u, v    axes of the first face: outward and along it; vectors in these are (height, u, v) [m]
F, P, Q    middle of the other face, and halves of its edges: its points are F + αP + βQ, |α| ≤ 1, |β| ≤ 1
form       k, l, m: how far a point is in some direction, k + lα + mβ
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, absolute, either, given, maximum, minimum, where
from articulated.simulation.contact.narrow.placed import FAR, Block, Touch
from articulated.spatial import Vec3

PREFERENCE = 1e-4
"""How much larger a distance [m] or a cosine must be than one before it to take its place."""
FARTHEST = 1e12
"""More than any distance [m], and any product of two."""
_DIRECTION = (0.8251, 0.5650)
"""Along u and v, where points are sought first. Turned boxes have sides at simple fractions of a right angle, and no point is
extreme alone in a direction square to a side; this one is at the golden section of a right angle."""
_STEEP = 400.0
"""Reciprocal of the slope from which on a face leans: its lowest point comes first then, up to 1 / 400 of how far others are.
Boxes that rest lean less, and it is the same point whatever the noise."""
_ASKEW = 1e-3
"""Slope of the line that points are sought far from: they would take turns if two were as far."""
_SAME = 1e-10
"""Square of the distance below which two points are one [m²]."""
_FLAT = 1e-4
"""Three points are two if the height of their triangle is this part of its base."""
_OVER = 1e-6
"""By what part of its size a face reaches over its border, lest rounding should take a corner away that two faces share."""
_SLIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class Axes:
    """A box by its axes: unit vectors, and half its lengths along them."""

    center: Vec3
    axes: tuple[Vec3, ...]
    half: tuple[Scalar, ...]

    @staticmethod
    def of(block: Block) -> Axes:
        return Axes(block.center, block.R.T.rows, block.half)

    def from_axis(self, k: Scalar) -> Axes:
        """The same with its axes counted from the k-th."""
        first, second, third = ((self.axes[i:] + self.axes[:i], self.half[i:] + self.half[:i]) for i in range(3))
        return Axes(self.center, *either(k < 0.5, first, either(k < 1.5, second, third)))


@dataclass(frozen=True, eq=False)
class _Place:
    """A point of a face: its α and β, and how far it is in the direction in which it was sought."""

    alpha: Scalar
    beta: Scalar
    value: Scalar


def largest(values: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
    """The largest of some numbers, or one before it that is almost as large, and which it is."""
    best, which = values[0], 0.0
    for k, value in enumerate(values[1:], 1):
        best, which = either(value > best + PREFERENCE, (value, float(k)), (best, which))
    return best, which


def faces(A: Axes, B: Axes, which: Scalar, towards: Vec3) -> tuple[list[Touch], Scalar]:
    """Of a face of one box and what is over it of the other's, and whether anything is.

    Args:
        A, B: the boxes.
        which: the face's axis: 0, 1, 2 of a, then 3, 4, 5 of b.
        towards: from b to a.
    """
    of_b = which > 2.5
    base, other = either(of_b, (B, A), (A, B))
    base = base.from_axis(where(of_b, which - 3.0, which))
    n, u, v = base.axes
    normal = n * where(n.dot(towards) < 0.0, -1.0, 1.0)
    n = normal * where(of_b, 1.0, -1.0)
    face, p, q = _facing(other, n)
    face = face + (other.center - base.center)
    F, P, Q = (Vec3(n.dot(x), u.dot(x), v.dot(x)) for x in (face, p, q))
    tall, wide, long = base.half
    patch = _Patch(Vec3(F.x - tall, F.y, F.z), P, Q, wide * (1.0 + _OVER), long * (1.0 + _OVER))
    places, is_there = patch.four()
    touches = []
    for place, there in zip(places, is_there, strict=True):
        height = patch.F.x + P.x * place.alpha + Q.x * place.beta
        point = base.center + face + p * place.alpha + q * place.beta - n * (0.5 * height)
        touches.append(Touch(where(there, height, FAR), normal, point))
    return touches, places[0].value > -FARTHEST


def _facing(box: Axes, n: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """The face that looks most against a direction: its middle from the box's, and halves of its edges."""
    _, most = largest([absolute(n.dot(axis)) for axis in box.axes])
    box = box.from_axis(most)
    out, p, q = (axis * half for axis, half in zip(box.axes, box.half, strict=True))
    return out * where(n.dot(out) < 0.0, 1.0, -1.0), p, q


@dataclass(frozen=True, eq=False)
class _Patch:
    """A face over another, in whose axes it is given: what of it lies within a rectangle.

    Attributes:
        F, P, Q: the face; see the module's first lines.
        wide, long: half the rectangle's lengths along u and v [m].
    """

    F: Vec3
    P: Vec3
    Q: Vec3
    wide: Scalar
    long: Scalar

    def four(self) -> tuple[list[_Place], list[Scalar]]:
        """Extreme places, and masks of those that are there; if none is, the lowest corner is taken, wherever it is."""
        lowest = _Place(where(self.P.x < 0.0, 1.0, -1.0), where(self.Q.x < 0.0, 1.0, -1.0), -FARTHEST)
        low = self._form(Vec3(-_STEEP, *_DIRECTION))
        one, two = self._extreme(low, lowest), self._extreme(-low, lowest)
        u, v = self._from(two, one)
        base = u * u + v * v
        form = self._form(Vec3(0.0, _ASKEW * u - v, _ASKEW * v + u))
        left, by_left = self._beyond(form, one, base)
        right, by_right = self._beyond(-form, two, base)

        # nothing on one side: a triangle, or there is more beyond its other sides
        no_left, no_right = by_left <= 0.0, by_right <= 0.0
        is_one_sided = (minimum(by_left, by_right) <= 0.0) & (maximum(by_left, by_right) > 0.0)
        apex, side = either(no_left, (right, -1.0), (left, 1.0))
        none = apex, -1.0
        extra = given(is_one_sided, lambda: self._outside(one, two, apex, side), none)
        left, by_left = either(no_left, extra, (left, by_left))
        right, by_right = either(no_right, extra, (right, by_right))
        return [one, two, left, right], [True, base > _SAME, by_left > 0.0, by_right > 0.0]

    def _outside(self, one: _Place, two: _Place, apex: _Place, side: Scalar) -> tuple[_Place, Scalar]:
        """Beyond the other sides of a triangle, whose apex is on this side of its base; and by how much."""
        found = []
        for corner, turn in ((one, -side), (two, side)):
            u, v = self._from(corner, apex)
            found.append(self._beyond(self._form(Vec3(0.0, -(v * turn), u * turn)), apex, u * u + v * v))
        first, second = found
        return either(second[1] > first[1], second, first)

    def _from(self, a: _Place, b: _Place) -> tuple[Scalar, Scalar]:
        """From one place to another, along u and v."""
        alpha, beta = b.alpha - a.alpha, b.beta - a.beta
        return self.P.y * alpha + self.Q.y * beta, self.P.z * alpha + self.Q.z * beta

    def _beyond(self, form: Vec3, start: _Place, base: Scalar) -> tuple[_Place, Scalar]:
        """The farthest place, and by how much it is beyond a line from one where it starts, if that is not next to nothing."""
        value = _value(form, start.alpha, start.beta)
        place = self._extreme(form, _Place(start.alpha, start.beta, value))
        return place, place.value - value - _FLAT * base

    def _extreme(self, form: Vec3, start: _Place) -> _Place:
        """The place of the largest value that a form has, or where to start if there is none."""
        along_p, along_q = self._clipped(self.P, self.Q), self._clipped(self.Q, self.P)
        found = [(where(form.y > 0.0, end, begin), side, is_over) for side, begin, end, is_over in along_p]
        found += [(side, where(form.z > 0.0, end, begin), is_over) for side, begin, end, is_over in along_q]
        best = start
        for alpha, beta, is_there in (*found, *self._corners()):
            place = _Place(alpha, beta, _value(form, alpha, beta))
            best = either((place.value > best.value) & is_there, place, best)
        return best

    def _form(self, direction: Vec3) -> Vec3:
        """How far a point is in a direction: k, l and m of k + lα + mβ."""
        return Vec3(direction.dot(self.F), direction.dot(self.P), direction.dot(self.Q))

    def _clipped(self, along: Vec3, across: Vec3) -> list[tuple[float, Scalar, Scalar, Scalar]]:
        """Of the two edges along P or Q: on which side, where what is over the rectangle begins and ends, whether any is."""
        rates = [1.0 / where(absolute(x) > _SLIGHT, x, _SLIGHT) for x in (along.y, along.z)]
        edges = []
        for side in (-1.0, 1.0):
            begin, end = -1.0, 1.0
            middles = (self.F.y + across.y * side, self.F.z + across.z * side)
            for middle, half, rate in zip(middles, (self.wide, self.long), rates, strict=True):
                center, reach = -(middle * rate), absolute(half * rate)
                begin, end = maximum(begin, center - reach), minimum(end, center + reach)
            edges.append((side, begin, end, begin <= end))
        return edges

    def _corners(self) -> list[tuple[Scalar, Scalar, Scalar]]:
        """The rectangle's corners as points of the face, and whether they are under it."""
        F, P, Q = self.F, self.P, self.Q
        rate = 1.0 / (P.y * Q.z - P.z * Q.y)  # faces that look at each other are not upright on each other
        alpha, alpha_u, alpha_v = (Q.y * F.z - Q.z * F.y) * rate, self.wide * Q.z * rate, -(self.long * Q.y * rate)
        beta, beta_u, beta_v = (P.z * F.y - P.y * F.z) * rate, -(self.wide * P.z * rate), self.long * P.y * rate
        corners = []
        for u in (-1.0, 1.0):
            for v in (-1.0, 1.0):
                s, t = alpha + alpha_u * u + alpha_v * v, beta + beta_u * u + beta_v * v
                corners.append((s, t, (absolute(s) < 1.0 + _OVER) & (absolute(t) < 1.0 + _OVER)))
        return corners


def _value(form: Vec3, alpha: Scalar, beta: Scalar) -> Scalar:
    """Of a form at a place."""
    return form.x + form.y * alpha + form.z * beta
