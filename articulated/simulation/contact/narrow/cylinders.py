"""A cylinder's distance from points and lines, and how far it reaches.

Ericson, Real-Time Collision Detection (2005), 5.1, has no cylinder. A point is clamped to it as to a box (5.1.3), in the plane
through the axis. The square of the distance is convex along a line, and smooth but for its curvature, so that the nearest
point of a line is found by a few of Newton's steps. They converge without a bracket: measured, with all kinds of lines and
cylinders.

symbol   meaning
z, ρ     of a point: along the axis from the middle, and distance from the axis [m]
t        place on a line, −1 and 1 at its ends
"""

from __future__ import annotations

from dataclasses import dataclass

from articulated.scalar import Scalar, absolute, either, maximum, minimum, sqrt, where
from articulated.simulation.contact.narrow.placed import Roller, Touch
from articulated.simulation.contact.narrow.reduction import Across
from articulated.spatial import Vec3

_STEPS = 5
_LEVEL = 1e-4
"""Square of the slope below which a line counts as parallel to what is nearest to it: there it is nearest in the middle."""
_SLIGHT = 1e-12
_TINY = 1e-24


def distance(roller: Roller, point: Vec3) -> tuple[Scalar, Vec3]:
    """How far a point is from a cylinder, negative inside, and the unit vector away from the nearest of side, end and rim."""
    p = point - roller.center
    z = roller.axis.dot(p)
    across = p - roller.axis * z
    square = across.dot(across)
    is_off = square > _TINY
    rho = sqrt(where(is_off, square, _TINY))
    outward = either(is_off, across * (1.0 / rho), Across.of(roller.axis).u)
    beside, above = rho - roller.radius, absolute(z) - roller.half
    is_rim = (beside > 0.0) & (above > 0.0)
    from_rim = sqrt(where(is_rim, beside * beside + above * above, 1.0))
    is_side = beside > above
    part = where(is_rim, beside / from_rim, where(is_side, 1.0, 0.0))
    along = where(is_rim, above / from_rim, where(is_side, 0.0, 1.0))
    size = where(is_rim, from_rim, maximum(beside, above))
    return size, outward * part + roller.axis * where(z < 0.0, -along, along)


def ball(roller: Roller, center: Vec3, radius: Scalar) -> Touch:
    """Where a ball touches a cylinder; the normal goes from this to the ball."""
    size, normal = distance(roller, center)
    size = size - radius
    return Touch(size, normal, center - normal * (radius + 0.5 * size))


def reach(roller: Roller, n: Vec3) -> Scalar:
    """How far a cylinder reaches from its middle along a unit vector [m]."""
    cosine = roller.axis.dot(n)
    across = n - roller.axis * cosine  # 1 − cosine² would be rounded to 1e-8 of the radius where the two are parallel
    return roller.radius * sqrt(across.dot(across)) + roller.half * absolute(cosine)


@dataclass(frozen=True, eq=False)
class Course:
    """How a line runs past a cylinder: z = z₀ + z₁ t, ρ² = q₀ + 2 q₁ t + q₂ t².

    Attributes:
        z, q: the coefficients.
        level: what q₂ and z₁² are compared with [m²].
    """

    z: tuple[Scalar, Scalar]
    q: tuple[Scalar, Scalar, Scalar]
    level: Scalar

    @staticmethod
    def of(roller: Roller, middle: Vec3, half: Vec3) -> Course:
        """Of the line from middle − half to middle + half."""
        p = middle - roller.center
        z0, z1 = roller.axis.dot(p), roller.axis.dot(half)
        q0, q1, length = p.dot(p) - z0 * z0, p.dot(half) - z0 * z1, half.dot(half)
        return Course((z0, z1), (q0, q1, maximum(length - z1 * z1, 0.0)), maximum(_LEVEL * length, _TINY))

    def beside(self, half: Scalar) -> tuple[Scalar, Scalar]:
        """Where the part between a cylinder's ends begins and ends; it may be beyond the line's ends."""
        z0, z1 = self.z
        rate = 1.0 / where(absolute(z1) > _SLIGHT, z1, _SLIGHT)
        one, other = (-half - z0) * rate, (half - z0) * rate
        return minimum(one, other), maximum(one, other)

    def over(self, radius: Scalar) -> tuple[Scalar, Scalar]:
        """The same of the part over a cylinder's end; in wrong order if there is none."""
        q0, q1, q2 = self.q
        scale = 1.0 / maximum(q2, _TINY)
        square = q1 * q1 - q2 * (q0 - radius * radius)
        root = where(square < 0.0, -1.0, sqrt(maximum(square, 0.0)))
        return (-q1 - root) * scale, (-q1 + root) * scale

    def inside(self, radius: Scalar, half: Scalar) -> tuple[Scalar, Scalar]:
        """The middle of the part in a cylinder, and how deep that is; else a place near the cylinder, and less than zero."""
        (z0, z1), (q0, q1, q2) = self.z, self.q
        begin, end = _both(self.beside(half), self.over(radius))
        t = where(begin < end, 0.5 * (begin + end), self.middle(half))
        z, rho = z0 + z1 * t, sqrt(maximum(q0 + t * (2.0 * q1 + t * q2), _TINY))
        return t, minimum(radius - rho, half - absolute(z))

    def middle(self, half: Scalar) -> Scalar:
        """Of the part between a cylinder's ends, the place that is nearest to its axis; if the two are parallel, the middle."""
        _, q1, q2 = self.q
        begin, end = _both(self.beside(half), (-1.0, 1.0))
        is_beside = begin < end
        begin, end = where(is_beside, begin, -1.0), where(is_beside, end, 1.0)
        t = 0.5 * (begin + end)
        return minimum(maximum(t - (q1 + q2 * t) / maximum(q2, self.level), begin), end)

    def nearest(self, radius: Scalar, half: Scalar, t: Scalar) -> Scalar:
        """The place that is nearest to a cylinder about the same axis; sought from t, where it stays if that is inside."""
        (z0, z1), (q0, q1, q2) = self.z, self.q
        for _ in range(_STEPS):
            z, rho = z0 + z1 * t, sqrt(maximum(q0 + t * (2.0 * q1 + t * q2), _TINY))
            beside, above = rho - radius, absolute(z) - half
            slope = (q1 + q2 * t) / rho
            pull, curvature = where(z < 0.0, -z1, z1) * maximum(above, 0.0), where(above > 0.0, z1 * z1, 0.0)
            pull = pull + maximum(beside, 0.0) * slope
            curvature = curvature + where(beside > 0.0, slope * slope + beside * (q2 - slope * slope) / rho, 0.0)
            t = minimum(maximum(t - pull / maximum(curvature, self.level), -1.0), 1.0)
        return t


def _both(a: tuple[Scalar, Scalar], b: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    """What two parts of a line have in common, on the line."""
    return maximum(maximum(a[0], b[0]), -1.0), minimum(minimum(a[1], b[1]), 1.0)
