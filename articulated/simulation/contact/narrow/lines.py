"""The nearest points of two lines: Ericson, Real-Time Collision Detection (2005), 5.1.9."""

from __future__ import annotations

from articulated.scalar import Scalar, maximum, minimum

_PARALLEL = 1e-9
"""Square of the sine of the angle below which any point of a line is as near."""


def clamped(t: Scalar, low: float = -1.0) -> Scalar:
    """The place between the ends of a line that is nearest to one."""
    return minimum(maximum(t, low), 1.0)


def nearest(aa: Scalar, bb: Scalar, ab: Scalar, ar: Scalar, br: Scalar, low: float = -1.0) -> tuple[Scalar, Scalar]:
    """Where p + s a and q + t b are nearest to each other: s and t, from `low` to 1.

    Args:
        aa, bb, ab: dot products of a and b.
        ar, br: and those with r = p − q.
        low: −1 for lines given by their middle, 0 for those given by an end.
    """
    s = clamped((ab * br - ar * bb) / maximum(aa * bb - ab * ab, _PARALLEL * aa * bb), low)
    t = clamped((ab * s + br) / bb, low)
    return clamped((ab * t - ar) / aa, low), t
