"""A normal turned until what is in front of two bodies crosses.

Along a normal, the lowest corner or edge of one body is in front of the highest of the other. Seen along it, these cross if
the bodies are not farther apart along any normal near by. If they are beside each other, they are farther apart along one that
is turned towards the line between their nearest points, which is the way of steepest ascent (the least of all subgradients;
Rockafellar, Convex Analysis, 1970, chapter 27). It is turned until another corner comes to the front, as in `arcs`.

symbol   meaning
n        normal, from b to a; a's lowest corners and b's highest are in front
m        unit vector square to n, from what is in front of b to what is in front of a
h        how far behind those in front a corner is [m]
r        cotangent of the angle by which the normal turns: n r + m is along the new one
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, either, given, least, maximum, sqrt, where
from articulated.simulation.contact.narrow.lines import nearest
from articulated.spatial import Vec3

_LEVEL = 1e-7
"""Two corners that are as far in front, but for this, are an edge [m]."""
_CROSSING = 1e-7
"""What is nearer to each other than this, seen along the normal, crosses [m]."""
_SLIGHT = 1e-9
_LEAST = 1e-3
_TINY = 1e-18


@dataclass(frozen=True, eq=False)
class _Front:
    """What of a body is in front: an edge from x to y, or a corner, if they are one.

    Attributes:
        height: along the normal [m].
        x, y: see above.
    """

    height: Scalar
    x: Vec3
    y: Vec3

    @staticmethod
    def of(heights: Sequence[Scalar], points: Sequence[Vec3]) -> _Front:
        """The two lowest, if they are as low as each other."""
        first, second, *others = zip(heights, points, strict=True)
        first, second = either(second[0] < first[0], (second, first), (first, second))
        for new in others:
            lower, is_second = new[0] < first[0], new[0] < second[0]
            first, second = either(lower, new, first), either(lower, first, either(is_second, new, second))
        (low, x), (next_low, y) = first, second
        return _Front(low, x, either(next_low - low < _LEVEL, y, x))


def turned(n: Vec3, a: Sequence[Vec3], b: Sequence[Vec3], steps: int) -> Vec3:
    """A normal along which corners of a and b are farther apart, or the same if there is none near by."""
    if steps == 0:
        return n
    down, up = [n.dot(x) for x in a], [-n.dot(x) for x in b]
    front, other = _Front.of(down, a), _Front.of(up, b)
    apart = front.height + other.height
    between, p, q = _between(front, other, n)
    square = between.dot(between)
    is_beside = square > _CROSSING * _CROSSING
    distance = sqrt(where(is_beside, square, 1.0))
    m = between * (1.0 / distance)
    r = maximum(apart / distance, _LEAST)
    along_p, along_q = m.dot(p), m.dot(q)
    for x, height in zip(a, down, strict=True):
        r = maximum(r, (along_p - m.dot(x)) / (height - front.height + _SLIGHT))
    for x, height in zip(b, up, strict=True):
        r = maximum(r, (m.dot(x) - along_q) / (height - other.height + _SLIGHT))
    new = (n * r + m) * (1.0 / sqrt(1.0 + r * r))
    better = is_beside & (least([new.dot(x) for x in a]) + least([-new.dot(x) for x in b]) > apart)
    n = either(better, new, n)
    return given(better, lambda: turned(n, a, b, steps - 1), n)


def _between(front: _Front, other: _Front, n: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """Seen along the normal, the nearest points of two edges: from one to the other, and where on each."""

    def across(x: Vec3) -> Vec3:
        return x - n * n.dot(x)

    e, f, w = across(front.y - front.x), across(other.y - other.x), across(front.x - other.x)
    ee, ff, ef, ew, fw = e.dot(e), f.dot(f), e.dot(f), e.dot(w), f.dot(w)
    ee, ff = maximum(ee, _TINY), maximum(ff, _TINY)
    s, t = nearest(ee, ff, ef, ew, fw, low=0.0)
    return w + e * s - f * t, front.x + (front.y - front.x) * s, other.x + (other.y - other.x) * t
