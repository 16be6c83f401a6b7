"""Those who take particles on: who is there, whether they agree with ours, and how fast they are beside it."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from io import StringIO
from typing import Any

import numpy as np
from timing import median, turns

import articulated.particles as ap

PACKAGES = {"numba": "numba", "warp": "warp-lang", "taichi": "taichi"}
"""Modules of contenders that may be missing, and the packages that they are in."""


@dataclass(frozen=True)
class Contender:
    """Someone who takes particles on.

    Attributes:
        start: puts a state in: positions [m] and velocities [m/s], shape (n, 3).
        step: a call.
        state: takes the state out again.
    """

    start: Callable[[np.ndarray, np.ndarray], None]
    step: Callable[[], object]
    state: Callable[[], tuple[np.ndarray, np.ndarray]]


def of_system(system: ap.System, step: Callable[[], object]) -> Contender:
    """Ours, as users call it."""

    def start(x: np.ndarray, v: np.ndarray) -> None:
        system.x, system.v, system.time = x.astype(system.dtype), v.astype(system.dtype), 0.0

    return Contender(start, step, lambda: (system.x, system.v))


def of_arrays(x: np.ndarray, v: np.ndarray, step: Callable[[], object]) -> Contender:
    """One whose state is in two arrays of shape (n, 3 or more)."""

    def start(x0: np.ndarray, v0: np.ndarray) -> None:
        x[: len(x0), :3], v[: len(v0), :3] = x0, v0

    return Contender(start, step, lambda: (x[:, :3].copy(), v[:, :3].copy()))


def entered(makers: Mapping[str, Callable[[], Contender]]) -> dict[str, Contender]:
    """Those whose packages are installed; see `missing`."""
    found = {}
    for name, make in makers.items():
        with suppress(ModuleNotFoundError):
            found[name] = make()
    return found


def missing() -> list[str]:
    """Packages of contenders that are not installed."""
    return [package for module, package in PACKAGES.items() if find_spec(module) is None]


def taichi_for(dtype: Any) -> Any:
    """Taichi on one thread, its numbers in a format; fields made before are gone."""
    os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
    import taichi

    real = taichi.f32 if dtype == np.float32 else taichi.f64
    with redirect_stdout(StringIO()):  # it says that it starts, whatever it is told
        taichi.init(arch=taichi.cpu, cpu_max_num_threads=1, default_fp=real, fast_math=True, log_level=taichi.ERROR)
    return taichi


def errors(
    contenders: Mapping[str, Contender], x: np.ndarray, v: np.ndarray, calls: int, right: Contender, tolerance: float
) -> dict[str, float]:
    """How far each is from what is right after some calls: the largest difference of positions [m] and velocities [m/s].

    Raises:
        RuntimeError: one is farther than the tolerance: it does other work, or does it wrong.
    """
    found = {}
    for name, who in {"right": right, **contenders}.items():
        who.start(x, v)
        for _ in range(calls):
            who.step()
        found[name] = np.concatenate(who.state(), axis=1)[: len(x)]
    wanted = found.pop("right")
    result = {name: float(np.abs(got - wanted).max()) for name, got in found.items()}
    for name, error in result.items():
        if not error <= tolerance:
            raise RuntimeError(f"{name} is {error:.1e} from ours after {calls} calls; expected {tolerance:.0e} at most")
    return result


def raced(
    contenders: Mapping[str, Contender], x: np.ndarray, v: np.ndarray, calls: int, count: int = 5, least: float = 0.03
) -> dict[str, list[float]]:
    """Seconds a call of each in each turn; all begin again from the same state after so many calls, unseen by the clock."""

    def measure(who: Contender) -> float:
        passed, laps = 0.0, 0
        while passed < least:
            who.start(x, v)
            began = time.perf_counter()
            for _ in range(calls):
                who.step()
            passed, laps = passed + time.perf_counter() - began, laps + 1
        return passed / (laps * calls)

    return turns({name: lambda who=who: measure(who) for name, who in contenders.items()}, count)


@dataclass(frozen=True)
class Race:
    """Some contenders, timed.

    Attributes:
        taken: seconds a call, turn by turn.
        errors: see there.
        work: what a call does: steps of a particle, or of a spring.
    """

    taken: dict[str, list[float]]
    errors: dict[str, float]
    work: float

    def rate(self, name: str) -> float:
        """Work a second."""
        return self.work / median(self.taken, name)

    def cells(self, names: list[str]) -> list[str]:
        """Millions a second, and the error."""
        return [f"{self.rate(n) * 1e-6:.3g} ({self.errors[n]:.0e})" if n in self.taken else "-" for n in names]

    def against(self, ours: str, peers: list[str]) -> str:
        """How many times faster ours is than the fastest peer: the median of turns, its quartiles, and who that is."""
        there = [name for name in peers if name in self.taken]
        if ours not in self.taken or not there:
            return "-"
        best = min(there, key=lambda name: median(self.taken, name))
        ratios = [a / b for a, b in zip(self.taken[best], self.taken[ours], strict=True)]
        low, middle, high = statistics.quantiles(ratios, n=4, method="inclusive")
        return f"{middle:.2f} ({low:.2f} to {high:.2f}), {best}"


def heading(cells: list[str]) -> None:
    """The head of a table."""
    print(f"| {' | '.join(cells)} |\n|{'---|' * len(cells)}", flush=True)


def row(cells: list[str]) -> None:
    """A row of it."""
    print(f"| {' | '.join(cells)} |", flush=True)
