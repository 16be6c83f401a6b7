"""Particles: alone, in cloth, and in strands, beside numpy, SciPy, numba, Warp and Taichi doing the same work."""

from __future__ import annotations

import limits
import numpy as np
import particles_alone as alone
from contenders import Race, entered, errors, heading, raced, row

FORMATS = {"float64": (np.float64, 1e-9), "float32": (np.float32, 1e-3)}
"""With how far results may differ."""


def particles(native: bool) -> None:
    """Millions of steps of a particle, or of a spring, a second, on one core; behind it the largest difference of positions [m]
    and velocities [m/s] from `System.step` in float64, some steps after the same beginning. "Ours over" is how many times
    faster ours is than the fastest peer: the median of turns, and its quartiles.
    """
    peak, bandwidth = limits.peak(), limits.bandwidth()
    print(f"\nThis core does {peak * 1e-9:.0f} GF/s in float64, twice that in float32, and copies {bandwidth * 1e-9:.1f} GB/s.")
    _alone(peak, bandwidth)


def _alone(peak: float, bandwidth: float) -> None:
    work = limits.flops(alone.operations())
    print(
        f"\n### Particles alone\n\nWind, drag, a ground; {work} flop a step, and 13 numbers moved a call: seven in, six out.\n"
        "Peers in shares of what the core does at most: flops as ours needs them.\n"
    )
    names = list(alone.CONTENDERS)
    shares = ["kernel: of the peak", "of the bandwidth"]
    heading(["particles", "format", "steps a call", *names, "System.step over", "our kernel over", *shares])
    for format_, (dtype, tolerance) in FORMATS.items():
        for count in (10**4, 10**5, 10**6):
            for steps in (1, 10):
                x, v, inverse = alone.problem(count, dtype)
                makers = {
                    name: lambda make=make: make(x, v, inverse, steps)
                    for name, make in alone.CONTENDERS.items()
                    if (name != "System.step" or dtype is np.float64) and (name != "numpy" or steps == 1)
                }
                found = entered(makers)
                off = errors(found, x, v, 20 // steps, alone.ours(x, v, inverse, steps), tolerance)
                race = Race(raced(found, x, v, (100 if count < 10**6 else 10) // steps), off, count * steps)
                rate, size = race.rate("our kernel"), np.dtype(dtype).itemsize
                shares = [f"{rate * work / peak * size / 8:.0%}", f"{rate / steps * 13 * size / bandwidth:.0%}"]
                against = [race.against(who, alone.PEERS) for who in ("System.step", "our kernel")]
                row([f"{count:.0e}", format_, str(steps), *race.cells(names), *against, *shares])
