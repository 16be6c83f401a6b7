"""Elementary functions as polynomials, written over traced scalars: the same bits at every lane width and in exported C.

An argument is reduced to a small interval with explicit fused multiply-adds (Cody and Waite 1980), where a minimax polynomial
takes over (`tests/compiler/remez.py` makes the coefficients). What is chosen by value is chosen by masks. Each function has two
sets of numbers, for float64 and float32.

Errors in float64, measured in `tests/compiler/test_elementary.py`: sin and cos within 2 ulp for |x| ≤ 1e5, exp, log and atan2
within 3. Beyond, sin and cos lose accuracy slowly; for |x| > 3e15 (in float32 6e6), where neighbouring numbers are about a
radian apart, they mean nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from articulated.scalar import Scalar, absolute, maximum, minimum, where

Traced = Any

# for float64, then for float32
_MAGIC = 1.5 * 2.0**52, 1.5 * 2.0**23
"""Added to a number and taken off again it leaves the nearest integer k; the sum's last bits are those of k."""
_HALF_PI = (
    (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33),
    (float.fromhex("0x1.921fb6p+0"), float.fromhex("-0x1.777a5cp-25"), float.fromhex("-0x1.ee59dap-50")),
)
_LN2 = (
    (0.6931471805599453, 2.3190468138462996e-17),
    (float.fromhex("0x1.62e430p-1"), float.fromhex("-0x1.05c610p-29")),
)
_EXP_RANGE = (-708.0, 709.0), (-87.0, 88.0)
_SIN = (
    (
        -0.16666666666666632,
        0.008333333333322425,
        -0.00019841269829817004,
        2.7557313695230474e-06,
        -2.5050758652014946e-08,
        1.5896827768330364e-10,
    ),
    (
        -0.16666654943632273,
        0.008332178141581138,
        -0.00019517298341104598,
    ),
)
_COS = (
    (
        0.041666666666666595,
        -0.0013888888888873056,
        2.480158728885196e-05,
        -2.7557314179386854e-07,
        2.0875700855586285e-09,
        -1.1358537269227916e-11,
    ),
    (
        0.041666645683226984,
        -0.001388731626457033,
        2.4433157977674177e-05,
    ),
)
_EXP = (
    (
        0.5000000000000011,
        0.16666666666666413,
        0.04166666666653033,
        0.00833333333349432,
        0.0013888888943580254,
        0.000198412695067388,
        2.4801493155276068e-05,
        2.755758635791014e-06,
        2.763022694372811e-07,
        2.5000028064883866e-08,
    ),
    (
        0.4999999345269074,
        0.16666520691553752,
        0.041668386933454475,
        0.008368709767760217,
        0.0013814642843254443,
    ),
)
_LOG = (
    (
        0.6666666666666734,
        0.3999999999941449,
        0.2857142874242291,
        0.2222219857010229,
        0.18183564466139793,
        0.15314047360686148,
        0.1479597856154538,
    ),
    (
        0.6666677638202184,
        0.3997754154308626,
        0.2987172878515703,
    ),
)
_ATAN = (
    (
        -0.333333333333332,
        0.19999999999954085,
        -0.14285714280248585,
        0.1111111078613855,
        -0.09090897836430581,
        0.07692061636537141,
        -0.06663120376894571,
        0.058480088702011046,
        -0.050398453386538526,
        0.0380783174739861,
        -0.017922276329357462,
    ),
    (
        -0.3333331550536785,
        0.199984894457966,
        -0.14243848909411497,
        0.10596002630227791,
        -0.06083455459632706,
    ),
)


def nearest(x: Traced, single: bool) -> Scalar:
    """The nearest integer, of what is smaller than 2⁵¹ (2²²)."""
    magic = _MAGIC[single]
    return (x + magic) - magic


def sin(x: Traced, single: bool) -> Scalar:
    """sin x."""
    turns, r, z = _quadrant(x, single)
    return _turned(x.of("bit", 0, turns), x.of("bit", 1, turns), _cos(r, z, single), _sin(r, z, single))


def cos(x: Traced, single: bool) -> Scalar:
    """cos x, the sine a quadrant on."""
    turns, r, z = _quadrant(x, single)
    return _turned(x.of("bit", 0, turns), x.of("bit", 1, turns + 1.0), _sin(r, z, single), _cos(r, z, single))


def exp(x: Traced, single: bool) -> Scalar:
    """eˣ; 0 or infinity where it would leave the normal numbers."""
    low, high = _EXP_RANGE[single]
    inside = minimum(maximum(x, low), high)
    magic, (c0, c1) = _MAGIC[single], _LN2[single]
    shifted = x.of("fma", inside, 1.0 / math.log(2.0), magic)
    k = shifted - magic
    r = x.of("fma", -k, c1, x.of("fma", -k, c0, inside))
    result = x.of("fma", r * r, _polynomial(_EXP[single], r), r + 1.0) * x.of("power2", shifted)
    result = where(x < low, 0.0, where(x > high, math.inf, result))
    return where(x == x, result, x)


def log(x: Traced, single: bool) -> Scalar:
    """The natural logarithm; subnormal numbers count as 0."""
    k, fraction = x.of("exponent", x), x.of("fraction", x)
    f = fraction - 1.0
    s = f / (f + 2.0)
    z = s * s
    c0, c1 = _LN2[single]
    # log(1+f) = 2s + sz P(z), and 2s = f − s f keeps what f has
    rest = x.of("fma", s, z * _polynomial(_LOG[single], z) - f, k * c1)
    result = x.of("fma", k, c0, f + rest)
    smallest, largest = (2.0**-1022, 1.7976931348623157e308) if not single else (2.0**-126, 3.4028234663852886e38)
    result = where(x < smallest, -math.inf, where(x > largest, x, result))
    return where(x >= 0.0, result, math.nan)


def atan2(y: Scalar, x: Scalar, single: bool) -> Scalar:
    """The angle of the point (x, y); the sign of a zero is not looked at, and at the origin it is 0."""
    traced = y if hasattr(y, "graph") else x
    ax, ay = absolute(x), absolute(y)
    large, small = maximum(ax, ay), minimum(ax, ay)
    # small/large beyond tan π/8 is turned back by π/4
    beyond = small > (math.sqrt(2.0) - 1.0) * large
    over = where(beyond, small - large, small)
    under = where(beyond, small + large, large)
    t = over / where(under > 0.0, under, 1.0)
    z = t * t
    angle = traced.of("fma", t * z, _polynomial(_ATAN[single], z), t)
    h0, h1 = _HALF_PI[single][:2]
    angle = where(beyond, 0.5 * h0 + (angle + 0.5 * h1), angle)
    angle = where(ay > ax, h0 - (angle - h1), angle)
    angle = where(x < 0.0, 2.0 * h0 - (angle - 2.0 * h1), angle)
    return where(y < 0.0, -angle, angle)


def _quadrant(x: Traced, single: bool) -> tuple[Traced, Traced, Traced]:
    """magic + k, r and r² with x = k π/2 + r. The first step is exact for |k| < 2^52; the third matters where r is tiny."""
    magic, (c0, c1, c2) = _MAGIC[single], _HALF_PI[single]
    turns = x.of("fma", x, 2.0 / math.pi, magic)
    k = turns - magic
    r = x.of("fma", -k, c2, x.of("fma", -k, c1, x.of("fma", -k, c0, x)))
    return turns, r, r * r


def _sin(r: Traced, z: Traced, single: bool) -> Traced:
    return r.of("fma", r * z, _polynomial(_SIN[single], z), r)


def _cos(r: Traced, z: Traced, single: bool) -> Traced:
    return r.of("fma", z * z, _polynomial(_COS[single], z), r.of("fma", z, -0.5, 1.0))


def _turned(odd: Traced, negative: Traced, a: Traced, b: Traced) -> Scalar:
    chosen = where(odd, a, b)
    return where(negative, -chosen, chosen)


def _polynomial(coefficients: Sequence[float], z: Traced) -> Traced:
    result: Any = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        result = z.of("fma", result, z, c)
    return result
