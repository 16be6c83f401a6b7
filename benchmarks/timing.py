"""Fair timing on a noisy machine: contenders take turns, and what counts is the median of their ratios turn by turn."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError, version


def pin_to_one_core() -> None:
    """Stay on the last core that is ours; the system uses the first ones most."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def seconds(run: Callable[[], object], least: float) -> float:
    """Seconds that a call takes, by calling until `least` seconds have passed."""
    calls, began = 0, time.perf_counter()
    while True:
        run()
        calls += 1
        passed = time.perf_counter() - began
        if passed >= least:
            return passed / calls


def turns(contenders: dict[str, Callable[[], float]], count: int = 11) -> dict[str, list[float]]:
    """Seconds of each contender in each turn; a contender runs once and says how long it took."""
    for measure in contenders.values():
        measure()
    taken: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(count):
        for name, measure in contenders.items():
            taken[name].append(measure())
    return taken


def timed(run: Callable[[], object], least: float = 0.03) -> Callable[[], float]:
    """A contender made of a function to call."""
    return lambda: seconds(run, least)


def at_once(runs: Sequence[Callable[[], object]], least: float = 0.03) -> Callable[[], float]:
    """A contender made of functions that are called again and again at the same time, each in a thread of its own."""

    def measure() -> float:
        with ThreadPoolExecutor(len(runs)) as pool:
            return statistics.mean(pool.map(lambda run: seconds(run, least), runs))

    return measure


def ratio(taken: dict[str, list[float]], slow: str, fast: str) -> float:
    """The median of how many times longer one takes than another in the same turn."""
    return statistics.median(a / b for a, b in zip(taken[slow], taken[fast], strict=True))


def median(taken: dict[str, list[float]], name: str) -> float:
    """The median of a contender's seconds."""
    return statistics.median(taken[name])


def setting() -> str:
    """The machine and the versions, for the head of a table."""
    from articulated.compiler.machine import machine

    on = machine()
    lines = [f"{processor()}, {on.name} ({on.cpu}), Python {platform.python_version()}, {platform.system()}"]
    packages = []
    for name in (
        "articulated",
        "llvmlite",
        "numpy",
        "pin",
        "mujoco",
        "example-robot-data",
        "scipy",
        "numba",
        "warp-lang",
        "taichi",
    ):
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            packages.append(f"{name} -")
    return "\n".join([*lines, ", ".join(packages)])


def processor() -> str:
    """What the processor calls itself."""
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
