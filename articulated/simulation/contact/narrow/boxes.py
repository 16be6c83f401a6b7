"""Boxes against balls, capsules and each other.

A ball is clamped to the box: Ericson, Real-Time Collision Detection (2005), 5.1.3. Of a capsule, three balls are: where its
line is nearest to the box, and where the part of it begins and ends that lies over the face found there, so that a capsule
rests on two points, be it longer than the box or shorter. Differs from Ericson's segment and box (Eberly's, by cases): along
the line, the square of the distance to the box is a sum of three, of which each is zero while the line is between two faces,
so that its least value needs no cases.

Two boxes are farthest apart, or least deep in each other, along one of 15 axes: Gottschalk, Lin and Manocha, OBBTree (1996), in
the form of Ericson 4.4.1. If it is a face's, they touch where a face of one looks at a face of the other (see `blocks`), if it
belongs to two edges, where these are nearest to each other (Ericson 5.1.8). Differs: where edges lie almost along a face, the
points of that face take their place.

symbol   meaning
t        place on a line, -1 and 1 at its ends
p, d     middle and half of the line, in the box's axes [m]
slab     where on the line it is between two opposite faces
A, B, C  axes of two boxes, and the turn from those of b to those of a
"""

from __future__ import annotations

from dataclasses import dataclass

from articulated.scalar import Scalar, absolute, either, given, maximum, minimum, sqrt, where
from articulated.simulation.contact.narrow.blocks import FARTHEST, PREFERENCE, Axes, faces, largest
from articulated.simulation.contact.narrow.lines import clamped
from articulated.simulation.contact.narrow.placed import FAR, Block, Rod, Touch
from articulated.spatial import Mat3, Vec3

_TINY = 1e-12
"""Square of a distance to the box below which a point counts as inside [m²]."""
_SLIGHT = 1e-9
"""What takes the place of a smaller component of the line [m]."""
_LEVEL = 1e-6
"""Square of the slope below which a line is level with a face: there, its nearest point is the middle of what is over it."""
_WIDE = 1e6
"""More than any box or line measures [m]."""
_ALIGNED = 0.98
"""Cosine between the normals of two edges and of a face from which on the face takes their place."""
_PARALLEL = 1e-6
"""Square of the sine of the angle below which edges are parallel; then faces are all that can separate."""


@dataclass(frozen=True, eq=False)
class _Face:
    """The face that a point belongs to.

    Attributes:
        weights: 1 for its axis, 0 for the others.
        last, first: masks: its axis is the third; if it is not, it is the first.
    """

    weights: tuple[Scalar, Scalar, Scalar]
    last: Scalar
    first: Scalar

    @staticmethod
    def of(beyond: list[Scalar]) -> _Face:
        """That which a point is farthest beyond, or least far behind."""
        x, y, z = beyond
        first, last = x > y, z > maximum(x, y)
        weights = where(last, 0.0, where(first, 1.0, 0.0)), where(last, 0.0, where(first, 0.0, 1.0)), where(last, 1.0, 0.0)
        return _Face(weights, last, first)

    def of_three(self, values: list[Scalar]) -> Scalar:
        """The value of its axis."""
        x, y, z = values
        return where(self.last, z, where(self.first, x, y))


def rod_block(a: Rod, b: Block) -> list[Touch]:
    """The points of a rod and a box: one if it is a ball, else three."""
    p = b.R.transpose_times(a.center - b.center)
    if a.half is None:
        return [_ball(b, a.center, p, a.radius, _Face.of(_beyond(b, p)))]
    d = b.R.transpose_times(a.half)
    slabs = _Slabs.of(b, p, d, a.radius + sum(b.half))
    nearest = slabs.nearest()
    beyond = _beyond(b, p + d * nearest)
    face = _Face.of(beyond)
    places = (nearest, *slabs.ends(beyond, face))
    return [_ball(b, a.center + a.half * t, p + d * t, a.radius, face) for t in places]


def _beyond(b: Block, p: Vec3) -> list[Scalar]:
    """How far a point is beyond the faces of each axis."""
    return [absolute(x) - half for x, half in zip(p, b.half, strict=True)]


def _ball(b: Block, center: Vec3, p: Vec3, radius: float, face: _Face) -> Touch:
    """Of a ball about a point, that is p in the box's axes; if this is inside, it is the face that it has to leave by."""
    beyond = _beyond(b, p)
    outside = [maximum(x, 0.0) for x in beyond]
    square = Vec3.of(outside).dot(Vec3.of(outside))
    is_outside, distance = square > _TINY, sqrt(square)
    scale = 1.0 / where(is_outside, distance, 1.0)
    parts = [where(is_outside, x * scale, weight) for x, weight in zip(outside, face.weights, strict=True)]
    normal = b.R @ Vec3(*(where(x < 0.0, -part, part) for x, part in zip(p, parts, strict=True)))
    size = where(is_outside, distance, face.of_three(beyond)) - radius
    return Touch(size, normal, center - normal * (radius + 0.5 * size))


@dataclass(frozen=True, eq=False)
class _Slabs:
    """Where a line is between the faces of each axis.

    A line that is level with two faces is always between them, if it is not too far beyond: else the least tilt would send
    its nearest point to an end.

    Attributes:
        middles: where it is halfway.
        rates: how far along it a unit of length across is [1/m].
        halves: half the distances of the faces [m].
        weights: squares of the line's components [m²].
    """

    middles: list[Scalar]
    rates: list[Scalar]
    halves: list[Scalar]
    weights: list[Scalar]

    @staticmethod
    def of(b: Block, p: Vec3, d: Vec3, reach: float) -> _Slabs:
        """Of a line about p, level with faces that it is less than `reach` beyond."""
        steep = [where(absolute(x) > _SLIGHT, x, _SLIGHT) for x in d]
        weights = [x * x for x in steep]
        scale = 1.0 / (_LEVEL * (weights[0] + weights[1] + weights[2]))
        halves = [half + reach * maximum(1.0 - w * scale, 0.0) for half, w in zip(b.half, weights, strict=True)]
        rates = [1.0 / x for x in steep]
        middles = [-(x * rate) for x, rate in zip(p, rates, strict=True)]
        return _Slabs(middles, [absolute(rate) for rate in rates], halves, weights)

    def bounds(self, k: int, more: Scalar = 0.0) -> tuple[Scalar, Scalar]:
        """Beginning and end of a slab, its faces moved out."""
        middle, half = self.middles[k], (self.halves[k] + more) * self.rates[k]
        return middle - half, middle + half

    def nearest(self) -> Scalar:
        """The place nearest to the box; of many, their middle, so also where the line goes through the box.

        In there the middle is far from the faces that the line goes through, so that it is seldom one of these that the line
        has to leave by; how deep it is, its ends tell.
        """
        slabs = [self.bounds(k) for k in range(3)]
        (begin, end), weight_begin, weight_end = slabs[0], self.weights[0], self.weights[0]
        for (b, e), weight in zip(slabs[1:], self.weights[1:], strict=True):
            later, sooner = b > begin, e < end
            begin, weight_begin = either(later, (b, weight), (begin, weight_begin))
            end, weight_end = either(sooner, (e, weight), (end, weight_end))
        # if no place is in all slabs, two of them pull at it, and perhaps the third
        t = (weight_begin * begin + weight_end * end) / (weight_begin + weight_end)
        w = self.weights
        pull = [weight * minimum(maximum(t, b), e) for (b, e), weight in zip(slabs, w, strict=True)]
        t = (pull[0] + pull[1] + pull[2]) / (w[0] + w[1] + w[2])
        shared = begin < end
        return 0.5 * (clamped(where(shared, begin, t)) + clamped(where(shared, end, t)))

    def ends(self, beyond: list[Scalar], face: _Face) -> tuple[Scalar, Scalar]:
        """Where the part over a face begins and ends, for a nearest point so far beyond the faces.

        If that lies beside the face, then so much more does the part reach beyond: a capsule may lie along an edge.
        """
        begin, end = -1.0, 1.0
        for k in range(3):
            b, e = self.bounds(k, 2.0 * maximum(beyond[k], 0.0) + _WIDE * face.weights[k])
            begin, end = maximum(begin, b), minimum(end, e)
        return begin, end


def block_block(a: Block, b: Block) -> list[Touch]:
    """The points of two boxes, four of them; those that are not there are far."""
    A, B = Axes.of(a), Axes.of(b)
    apart = A.center - B.center
    C = [[x.dot(y) for y in B.axes] for x in A.axes]
    size, face = _best_face(A, B, C, apart)
    edge_size, i, j = _best_edges(A, B, C, apart)
    edges = A.from_axis(i), B.from_axis(j)
    normal = _square_to(*edges, apart)

    # where edges lie almost along a face, the points of that face have their distance, and are more than one; the way to the
    # other box is then that between the edges: of long boxes, middles may be anywhere
    cross = edge_size > size + PREFERENCE
    aligned, face_of_edges = largest([absolute(normal.dot(axis)) for axis in (*A.axes, *B.axes)])
    touches, is_over = faces(A, B, where(cross, face_of_edges, face), either(cross, normal, apart))
    cross = cross & (aligned < where(is_over, _ALIGNED, 2.0))

    first, *others = touches
    none = first, [touch.size for touch in others]
    first, sizes = given(cross, lambda: (_crossing(*edges, normal), [FAR] * len(others)), none)
    return [first, *(Touch(size, first.normal, touch.point) for size, touch in zip(sizes, others, strict=True))]


def _best_face(A: Axes, B: Axes, C: list[list[Scalar]], apart: Vec3) -> tuple[Scalar, Scalar]:
    """How far apart two boxes are along an axis of a face, and which: 0, 1, 2 of a, then 3, 4, 5 of b."""
    turn = Mat3(*(Vec3(*(absolute(x) for x in row)) for row in C))
    sizes = []
    for box, reach in ((A, turn @ Vec3.of(B.half)), (B, turn.transpose_times(Vec3.of(A.half)))):
        sizes += [absolute(x.dot(apart)) - (h + r) for x, h, r in zip(box.axes, box.half, reach, strict=True)]
    return largest(sizes)


def _best_edges(A: Axes, B: Axes, C: list[list[Scalar]], apart: Vec3) -> tuple[Scalar, Scalar, Scalar]:
    """How far apart two boxes are along an axis square to an edge of each, and which edges.

    Axes are compared by s |s| / l², where s is that for an axis of length l: roots and quotients are for the best one only.
    """
    turn = [[absolute(x) for x in row] for row in C]
    along = [x.dot(apart) for x in A.axes]
    best, square, which = -FARTHEST, 1.0, 0.0
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            m, n = (j + 1) % 3, (j + 2) % 3
            of_a = A.half[k] * turn[l][j] + A.half[l] * turn[k][j]
            of_b = B.half[m] * turn[i][n] + B.half[n] * turn[i][m]
            s = absolute(along[l] * C[k][j] - along[k] * C[l][j]) - (of_a + of_b)
            s, length = s * absolute(s), C[k][j] * C[k][j] + C[l][j] * C[l][j]
            better = (s * square > best * length) & (length > _PARALLEL)
            best, square = where(better, s, best), where(better, length, square)
            which = where(better, 3.0 * i + j, which)
    size = sqrt(absolute(best) / square)
    i = where(which < 2.5, 0.0, where(which < 5.5, 1.0, 2.0))
    return where(best < 0.0, -size, size), i, which - 3.0 * i


def _square_to(A: Axes, B: Axes, apart: Vec3) -> Vec3:
    """The unit vector square to the first axis of each box, from b to a."""
    normal = A.axes[0].cross(B.axes[0])
    length = sqrt(maximum(normal.dot(normal), _PARALLEL))
    return normal * (where(normal.dot(apart) < 0.0, -1.0, 1.0) / length)


def _crossing(A: Axes, B: Axes, normal: Vec3) -> Touch:
    """Of two edges, along the first axis of each box: those that are outermost towards the other."""
    e, f = A.axes[0], B.axes[0]
    x, y = _outermost(A, -normal), _outermost(B, normal)
    between = x - y
    cosine, along_e, along_f = e.dot(f), e.dot(between), f.dot(between)
    rate = 1.0 / maximum(1.0 - cosine * cosine, _PARALLEL)
    s, t = (cosine * along_f - along_e) * rate, (along_f - cosine * along_e) * rate
    s, t = (minimum(maximum(x, -half), half) for x, half in ((s, A.half[0]), (t, B.half[0])))
    return Touch(normal.dot(between), normal, (x + e * s + y + f * t) * 0.5)


def _outermost(box: Axes, direction: Vec3) -> Vec3:
    """The middle of that edge along the first axis that is farthest in a direction."""
    point = box.center
    for axis, half in zip(box.axes[1:], box.half[1:], strict=True):
        point = point + axis * where(axis.dot(direction) < 0.0, -half, half)
    return point
