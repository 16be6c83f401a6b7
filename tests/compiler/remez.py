"""Makes the coefficients in `articulated/compiler/elementary.py`: minimax polynomials by Remez exchange, in 40 digits.

    python tests/compiler/remez.py

Each is P in  f(x) = head(x) + tail(x) P(w),  where head and tail are exact in use and w is x² (or x); what is made small is the
error relative to f. Prints the coefficients from the constant one up, and the error in units of 2^-53.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp

mp.mp.dps = 60


def remez(P: Callable, weight: Callable, low: float, high: float, terms: int) -> tuple[list, mp.mpf]:
    """The polynomial p of this many terms for which max |weight (P − p)| on [low, high] is least."""
    n = terms + 1
    low, high = mp.mpf(low), mp.mpf(high)
    nodes = [(low + high) / 2 - (high - low) / 2 * mp.cos(mp.pi * k / (n - 1)) for k in range(n)]
    for _ in range(12):
        rows = mp.matrix(n, n)
        right = mp.matrix(n, 1)
        for i, w in enumerate(nodes):
            for j in range(terms):
                rows[i, j] = w**j
            rows[i, terms] = (-1) ** i / weight(w)
            right[i] = P(w)
        solution = mp.lu_solve(rows, right)
        coefficients = [solution[j] for j in range(terms)]

        def error(w, coefficients=coefficients):
            return weight(w) * (P(w) - mp.polyval(coefficients[::-1], w))

        grid = [low + (high - low) * mp.mpf(k) / 400 for k in range(401)]
        values = [error(w) for w in grid]
        extremes: list = []  # the largest error between changes of sign
        for w, e in zip(grid, values, strict=True):
            if extremes and mp.sign(e) == mp.sign(extremes[-1][1]):
                if abs(e) > abs(extremes[-1][1]):
                    extremes[-1] = (w, e)
            else:
                extremes.append((w, e))
        if len(extremes) < n:
            break
        while len(extremes) > n:
            extremes.pop(0 if abs(extremes[0][1]) < abs(extremes[-1][1]) else -1)
        nodes = [w for w, _ in extremes]
    return coefficients, max(abs(e) for e in values)


def _series(f: Callable, tiny: Callable) -> Callable:
    """f, but its Taylor series near zero, where f would cancel."""
    return lambda w: tiny(w) if abs(w) < mp.mpf(10) ** -12 else f(w)


QUARTER = (mp.pi / 4 * (1 + mp.mpf(10) ** -6)) ** 2
OCTANT = (mp.sqrt(2) - 1) ** 2 * (1 + mp.mpf(10) ** -6)
HALF_LN2 = mp.log(2) / 2 * (1 + mp.mpf(10) ** -6)
LOG_END = ((mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)) ** 2 * (1 + mp.mpf(10) ** -6)


def sin_P(z):
    return (mp.sin(mp.sqrt(z)) / mp.sqrt(z) - 1) / z


def cos_P(z):
    return (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2


def exp_P(r):
    return (mp.exp(r) - 1 - r) / r**2


def log_P(z):
    return (2 * mp.atanh(mp.sqrt(z)) / mp.sqrt(z) - 2) / z


def atan_P(z):
    return (mp.atan(mp.sqrt(z)) / mp.sqrt(z) - 1) / z


FUNCTIONS = {  # name: (P, its value near 0, weight that makes the error relative, interval, terms in double, in single)
    "sin": (sin_P, lambda z: -mp.mpf(1) / 6, lambda z: z, (1e-9, QUARTER), 6, 3),
    "cos": (cos_P, lambda z: mp.mpf(1) / 24, lambda z: z**2 / mp.cos(mp.sqrt(z)), (1e-6, QUARTER), 6, 3),
    "exp": (exp_P, lambda r: mp.mpf(1) / 2, lambda r: r**2 / mp.exp(r), (-HALF_LN2, HALF_LN2), 10, 5),
    "log": (log_P, lambda z: mp.mpf(2) / 3, lambda z: z / 2, (1e-9, LOG_END), 7, 3),
    "atan": (atan_P, lambda z: -mp.mpf(1) / 3, lambda z: z, (1e-9, OCTANT), 11, 5),
}

if __name__ == "__main__":
    for name, (P, tiny, weight, (low, high), double, single) in FUNCTIONS.items():
        if name == "exp":
            weight = lambda r: max(r**2, mp.mpf(10) ** -8) / mp.exp(r)  # noqa: E731
        for terms in (double, single):
            coefficients, error = remez(_series(P, tiny), weight, low, high, terms)
            print(name, f"error {mp.nstr(error * 2**53, 3)}", [float(c) for c in coefficients])
