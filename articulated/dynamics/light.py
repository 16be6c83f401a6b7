"""The quick way of a call: plain arrays go to machine code at once, past everything that `calls` looks at.

What is unusual in any way (options, keywords, other types or shapes, numbers that are not finite) goes the usual way.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, ParamSpec

import numpy as np

from articulated.compiler import Kernel, crew, interpreting
from articulated.rig import Rig

P = ParamSpec("P")


@dataclass(slots=True)
class Light:
    """Quick ways for plain arguments: functions in machine code that say whether they could.

    Attributes:
        shape: of the result for one state.
        one: for a state in float64.
        many: for batches, by their type's character, with their kernels.
    """

    shape: tuple[int, ...]
    one: Callable[..., bool] = lambda *_: False
    many: dict[str, tuple[Callable[..., bool], Kernel]] = field(default_factory=dict)

    def batch(self, arguments: Sequence[Any], threads: int | None) -> np.ndarray | None:
        """The result for a batch of states, or None."""
        count, dtype = len(arguments[0]), arguments[0].dtype
        if (found := self.many.get(dtype.char)) is None or interpreting():
            return None
        run, kernel = found
        result = np.empty((count, *self.shape), dtype)
        threads = kernel.threads(count, threads)
        job = kernel.job(count, threads) if threads > 1 else None
        try:
            return result if run(*arguments, result, job) else None
        finally:
            if job is not None:
                crew.done()


lights: dict[str, dict[int, Light]] = {}
"""By the name of a function, and by the id of a rig."""


def light_path(function: Callable[P, np.ndarray]) -> Callable[P, np.ndarray]:
    """Let a public function answer at once for plain states, if a kernel for them is there already."""
    known = lights.setdefault(function.__name__, {})
    empty, ndarray = np.empty, np.ndarray

    @wraps(function)
    def entry(*arguments: Any, **options: Any) -> np.ndarray:
        light = None
        if len(arguments) > 1:
            light, first = known.get(id(arguments[0])), arguments[1]
        if light is not None and type(first) is ndarray:
            if first.ndim == 1 and not options:
                result = empty(light.shape)
                if light.one(*arguments[1:], result):
                    return result
            elif first.ndim == 2 and (not options or (len(options) == 1 and _is_count(options.get("threads")))):
                result = light.batch(arguments[1:], options.get("threads"))
                if result is not None:
                    return result
        return function(*arguments, **options)  # type: ignore[call-arg]

    return entry  # type: ignore[return-value]


def _is_count(x: Any) -> bool:
    return type(x) is int and x > 0


def offer(name: str, rig: Rig, kernel: Kernel, shape: tuple[int, ...]) -> None:
    """Let a function use a kernel for plain arguments of a rig.

    Args:
        name: of the function.
        rig: the rig; what is offered goes when it goes.
        kernel: takes the function's arrays and its result, and nothing else.
        shape: of the result for one state.
    """
    known = lights.get(name)
    if known is None or (run := kernel.light()) is None:
        return
    light = known.get(id(rig))
    if light is None:
        light = known[id(rig)] = Light(shape)
        weakref.finalize(rig, known.pop, id(rig), None).atexit = False
    if kernel.format.lanes > 1:
        light.many["f" if kernel.format.single else "d"] = run, kernel
    elif not kernel.format.single:
        light.one = run
