"""Particles: alone, in cloth, and in strands, beside numpy, SciPy, numba, Warp and Taichi doing the same work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import limits
import numpy as np
import particles_alone as alone
import particles_cloth as explicit
import particles_implicit as implicit
import particles_strands as strands
from contenders import Contender, Race, entered, errors, heading, missing, raced, row

OURS = ("System.step", "our kernel")


def particles(native: bool) -> None:
    """Steps of particles on one core, semi-implicit or implicit, in float64 and float32. Each contender: millions a second, and in
    brackets the largest difference of positions [m] and velocities [m/s] from `System.step` in float64, some steps after the
    same beginning. "Over" is how many times faster ours is than the fastest peer: the median of turns, its quartiles, and which.

    All begin each lap from the same state. Numbers go in and out of `System.step` as arrays of shape (n, 3); peers, and our
    kernel, have theirs where they like it best, and putting them there is not timed.
    """
    for package in missing():
        print(f"\n{package} is left out: it is not installed.")
    _alone()
    _cloth()
    _implicit()
    _strands()


def _alone() -> None:
    work, peak = limits.flops(alone.operations()), limits.peak()
    print(f"""
### Particles alone

Wind, drag and a ground, which 7 % meet in 0.1 s, and 0.4 % in the 0.01 s of a million. Ours does {work} flop a step of what meets nothing,
with quotients as IEEE 754 has them; numba may reorder, and estimates them in float32. A call moves 13 numbers of each particle at least.
This core does {peak * 1e-9:.0f} GF/s in float64, twice that in float32; the last columns are what our kernel does of that, and, where
no cache holds all particles, of the bytes a second that a copy moves right afterwards.
""")
    names = list(alone.CONTENDERS)
    heads = [*names, *(f"{who} over" for who in OURS), "of the flops", "of the bandwidth"]
    heading(["particles", "format", "steps a call", *heads])
    for dtype in (np.float64, np.float32):
        for count in (10**4, 10**5, 10**6):
            for steps in (1, 10):
                problem = alone.problem(count, dtype)
                given, left_out = (*problem, steps), ("numpy",) * (steps > 1)
                calls = (100 if count < 10**6 else 10) // steps
                race = _race(
                    {name: make for name, make in alone.CONTENDERS.items() if name not in left_out},
                    given,
                    given[:2],
                    alone.ours(*_wide(problem), steps),
                    count * steps,
                    tolerance=1e-9 if dtype is np.float64 else 1e-3,
                    seen=20 // steps,
                    calls=calls,
                )
                rate, size = race.rate("our kernel"), np.dtype(dtype).itemsize
                moved = f"{rate * 13 * size / limits.bandwidth():.0%}" if count == 10**6 and steps == 1 else "-"
                shares = [f"{rate * work / peak * size / 8:.0%}", moved]
                over = [race.against(who, alone.PEERS) for who in OURS]
                row([f"{count:.0e}", np.dtype(dtype).name, str(steps), *race.cells(names), *over, *shares])


def _cloth() -> None:
    print(f"""
### Cloth, semi-implicit

Millions of steps of a spring; {explicit.STEPS} steps a call. Of a spring five numbers are read, two of them of half the size; of
a particle with its six springs, at least twelve are read and twelve written; the last column is our share of what a copy moves.
""")
    names = list(explicit.CONTENDERS)
    heading(["particles", "springs", "format", *names, "ours over", "ours, of the bandwidth"])
    for dtype in (np.float64, np.float32):
        for side in (100, 300):
            given = explicit.cloth(side, dtype)
            springs, single = len(given.pairs), dtype is np.float32
            race = _race(
                explicit.CONTENDERS,
                (given,),
                (given.x, given.v),
                explicit.ours(explicit.cloth(side, float)),
                springs * explicit.STEPS,
                tolerance=1e-2 if single else 1e-9,
                seen=2,
                calls=3,
            )
            size = np.dtype(dtype).itemsize
            own = f"{race.rate('System.step') * (3 * size + 2 * 4 + 24 * size / 6) / limits.bandwidth():.0%}"
            over = race.against("System.step", [name for name in names if name not in OURS])
            row([f"{side} x {side}", str(springs), np.dtype(dtype).name, *race.cells(names), over, own])


def _implicit() -> None:
    print(f"""
### Cloth of 100 x 100, implicit

A step of {implicit.H * 1e3:.0f} ms, {implicit.ITERATIONS} iterations of conjugate gradients: millions of products of a spring's block a second.
""")
    names = list(implicit.CONTENDERS)
    heading(["format", *names, "ours over numba", "over SciPy"])
    for dtype in (np.float64, np.float32):
        given = explicit.cloth(100, dtype)
        single = dtype is np.float32
        race = _race(
            implicit.CONTENDERS,
            (given,),
            (given.x, given.v),
            implicit.ours_implicit_cloth(explicit.cloth(100, float)),
            len(given.pairs) * implicit.ITERATIONS,
            tolerance=1e-2 if single else 1e-9,
            seen=2,
            calls=10,
        )
        over = [race.against("System.step", some) for some in (["numba"], ["SciPy"])]
        row([np.dtype(dtype).name, *race.cells(names), *over])


def _strands() -> None:
    work, peak = limits.flops(strands.operations()), limits.peak()
    print(f"""
### Strands, implicit

{strands.STRANDS} strands of {strands.PARTICLES} particles, a step of {strands.H * 1e3:.0f} ms solved exactly: millions of steps of a particle.
Ours does {work} flop a particle; the last column is its share of what the core does at most.
""")
    names = list(strands.CONTENDERS)
    heading(["format", *names, "ours over", "over strand by strand", "over numpy", "of the flops"])
    for dtype in (np.float64, np.float32):
        given = strands.problem(dtype)
        single = dtype is np.float32
        race = _race(
            strands.CONTENDERS,
            given,
            given,
            strands.ours(*_wide(given)),
            strands.STRANDS * strands.PARTICLES,
            tolerance=1e-2 if single else 1e-9,
            seen=3,
            calls=50,
        )
        over = [race.against("System.step", some) for some in (names[1:], ["numba, strand by strand"], ["numpy"])]
        share = f"{race.rate('System.step') * work / peak * np.dtype(dtype).itemsize / 8:.0%}"
        row([np.dtype(dtype).name, *race.cells(names), *over, share])


def _race(
    makers: Mapping[str, Callable[..., Contender]],
    given: tuple[Any, ...],
    state: tuple[np.ndarray, np.ndarray],
    right: Contender,
    work: float,
    tolerance: float,
    seen: int,
    calls: int,
) -> Race:
    """Contenders made of what is given, checked over as many calls as are seen, and then timed."""
    there = entered({name: lambda make=make: make(*given) for name, make in makers.items()})
    off = errors(there, *state, seen, right, tolerance)
    return Race(raced(there, *state, calls), off, work)


def _wide(arrays: Sequence[np.ndarray]) -> list[np.ndarray]:
    """In float64."""
    return [array.astype(float) for array in arrays]
