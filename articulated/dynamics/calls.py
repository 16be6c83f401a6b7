"""From a public function to a kernel and back: arguments are looked at, code is found or made, and run.

A kernel tells of numbers that are not finite on its way through them; only then is what is wrong looked for, to be told in
words.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from articulated.compiler import (
    CHECK_FAILED,
    NOT_FINITE_IN,
    NOT_FINITE_OUT,
    Array,
    Program,
    Tape,
    compiled,
    evaluate,
    interpreting,
    kernels_of,
)
from articulated.dynamics.boundary import NORM_TOLERANCE, Argument, check_threads, checked
from articulated.dynamics.light import offer
from articulated.dynamics.mechanism import content, mechanism
from articulated.rig import Rig
from articulated.scalar import Nested, absolute, maximum


@dataclass(frozen=True, eq=False)
class _Request:
    """An algorithm, and what users gave for it.

    Attributes:
        rig, algorithm, arguments, shape, watched, options: as in `call`.
        given: those of the arguments that are not part of the program.
    """

    rig: Rig
    algorithm: Callable[..., Nested]
    arguments: Sequence[Argument]
    shape: tuple[int, ...]
    watched: bool
    options: dict[str, Any]

    @cached_property
    def given(self) -> list[Argument]:
        return [a for a in self.arguments if not a.fixed]


def call(
    rig: Rig,
    algorithm: Callable[..., Nested],
    arguments: Sequence[Argument],
    shape: tuple[int, ...],
    out: np.ndarray | None,
    threads: int | None,
    *,
    watched: bool = True,
    **options: Any,
) -> np.ndarray:
    """Check the arguments, run the algorithm on every state, and return its results, shape (*batch, *shape).

    Args:
        rig: the rig.
        algorithm: a function of a mechanism, a nested list of scalars for each argument, and the options.
        arguments: what users gave.
        shape: of the result for one state.
        out, threads: as users gave them.
        watched: whether numbers that are not finite are an error.
        options: constants that the algorithm depends on.

    Raises:
        ValueError: an argument is not of numbers, has the wrong shape, is not finite, or does not broadcast with the others;
            a quaternion is not of unit length; `out` does not fit; `threads` is not a positive number.
    """
    check_threads(threads)
    request = _Request(rig, algorithm, arguments, shape, watched, options)
    given = request.given
    arrays = [_array(rig, a) for a in given]
    batch = _broadcast_batch(rig, arrays, given)
    single = all(array.dtype == np.float32 for array, a in zip(arrays, given, strict=True) if a.role != "gravity")
    dtype = np.dtype(np.float32 if single else np.float64)
    arrays = [array if array.dtype == dtype else array.astype(dtype) for array in arrays]
    into = _result((*batch, *shape), dtype, out, arrays)
    count, interpreted = math.prod(batch), interpreting()
    if watched and (into.size == 0 or interpreted):
        for a in given:
            checked(rig, a)
    flags = 0
    if into.size:
        flags = _interpret(request, arrays, batch, into) if interpreted else _run(request, arrays, batch, count, into, threads)
    if watched and flags & (NOT_FINITE_IN | CHECK_FAILED):
        for a in given:
            checked(rig, a)
    if watched and flags & NOT_FINITE_OUT:
        _warn_of_singularity(rig, into, len(batch))
    if out is not None and into is not out:
        out[...] = into
    return into if out is None else out


def _name(algorithm: Callable[..., Nested]) -> str:
    """An algorithm has the name of the public function that runs it; where that is taken, after an underscore."""
    return algorithm.__name__.strip("_")


def _run(
    request: _Request,
    arrays: Sequence[np.ndarray],
    batch: tuple[int, ...],
    count: int,
    result: np.ndarray,
    threads: int | None,
) -> int:
    """Run compiled code."""
    form = tuple([a.value is None if a.fixed else ... for a in request.arguments])
    key = (request.algorithm, form, tuple(request.options.values()), result.dtype.char, count == 1)
    kernels = kernels_of(request.rig)
    if (kernel := kernels.get(key)) is None:
        kernel = kernels[key] = compiled(_program(request), result.dtype == np.float32, 1 if count == 1 else None)
        if all(a.fixed for a in request.arguments if a.role in ("gravity", "optional")) and not any(request.options.values()):
            offer(_name(request.algorithm), request.rig, kernel, request.shape)
    table = [states(array, batch, len(a.shape)) for array, a in zip(arrays, request.given, strict=True)]
    table.append((result, result.itemsize * math.prod(request.shape), 0, None))
    return kernel(table, count, threads)


def program(
    rig: Rig,
    algorithm: Callable[..., Nested],
    arguments: Sequence[Argument],
    shape: tuple[int, ...],
    *,
    watched: bool = True,
    **options: Any,
) -> Program:
    """What an algorithm compiles to; of the arguments' values only those that are fixed matter. See `call`."""
    return _program(_Request(rig, algorithm, arguments, shape, watched, options))


def _program(request: _Request) -> Program:
    rig, algorithm, arguments, given = request.rig, request.algorithm, request.arguments, request.given

    def write(tape: Tape, *scalars: Nested) -> list[Nested]:
        these = iter(scalars)
        return [algorithm(mechanism(rig), *(a.value if a.fixed else next(these) for a in arguments), **request.options)]

    def unfit(tape: Tape, *scalars: Nested) -> Any:
        tolerance = NORM_TOLERANCE[np.dtype(np.float32 if tape.graph.single else np.float64)]
        worst: Any = 0.0
        for a, q in zip(given, scalars, strict=True):
            for where in rig.quaternions.values() if a.role == "q" else ():
                worst = maximum(worst, absolute(sum(x * x for x in q[where]) - 1.0))
        return worst > 1.9 * tolerance  # the square's error is twice the norm's; a little less is looked at again

    form = [(a.name, a.shape, a.role, a.value if a.fixed else ...) for a in arguments]
    identity = algorithm.__module__, form, request.shape, request.watched, request.options
    return Program(
        name=_name(algorithm),
        content=repr(identity).encode() + content(rig),
        arguments=tuple(Array(a.name, a.shape) for a in given),
        results=(Array("result", request.shape),),
        write=write,
        unfit=unfit,
        watched=request.watched,
    )


def _interpret(request: _Request, arrays: Sequence[np.ndarray], batch: tuple[int, ...], result: np.ndarray) -> int:
    """Run it on numpy."""
    m, inputs, given = mechanism(request.rig), [], iter(arrays)
    for a in request.arguments:
        array = a.value if a.fixed else next(given)
        array = None if array is None else np.broadcast_to(np.asarray(array, result.dtype), (*batch, *a.shape))
        inputs.append((array, len(a.shape)))
    evaluate(lambda *scalars: request.algorithm(m, *scalars, **request.options), inputs, result, batch)
    return 0 if np.isfinite(result).all() else NOT_FINITE_OUT


def _array(rig: Rig, a: Argument) -> np.ndarray:
    """The argument as an array of numbers of the right shape; whether they are finite is left to look at."""
    value = a.value
    if type(value) is np.ndarray and value.dtype in NORM_TOLERANCE:
        core = len(a.shape)
        if value.shape[value.ndim - core :] == a.shape and value.ndim >= core:
            return value
    return checked(rig, a)


def _broadcast_batch(rig: Rig, arrays: Sequence[np.ndarray], given: Sequence[Argument]) -> tuple[int, ...]:
    batches = {array.shape[: array.ndim - len(a.shape)] for array, a in zip(arrays, given, strict=True)}
    if len(batches) == 1:
        return batches.pop()
    try:
        return np.broadcast_shapes(*batches)
    except ValueError:
        shapes = ", ".join(f"{a.name} {array.shape}" for array, a in zip(arrays, given, strict=True))
        raise ValueError(f"leading axes do not broadcast for rig {rig.name!r}: {shapes}") from None


def states(array: np.ndarray, batch: tuple[int, ...], core: int) -> tuple[np.ndarray, int, int, np.ndarray | None]:
    """An array as a kernel takes it: each state's numbers in a row, and states evenly spaced."""
    lead, shape = array.shape[: array.ndim - core], array.shape[array.ndim - core :]
    size, contiguous = math.prod(shape), array.flags.c_contiguous
    if contiguous and lead == batch:
        return array, array.itemsize * size, 0, None
    if contiguous and math.prod(lead) == 1:
        return array, 0, 0, None
    array = np.broadcast_to(array, (*batch, *shape)).reshape(math.prod(batch), size)  # a view if one can be had
    if size > 1 and array.strides[1] != array.itemsize:
        array = np.ascontiguousarray(array)
    return array, array.strides[0], 0, None


def _result(shape: tuple[int, ...], dtype: np.dtype, out: np.ndarray | None, arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Where to compute into: `out`, or if there is none or it cannot be computed into directly, a new array."""
    if out is None:
        return np.empty(shape, dtype)
    if not isinstance(out, np.ndarray) or out.shape != shape or out.dtype != dtype:
        got = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise ValueError(f"out is {got}; expected an array of {dtype}, shape {shape}")
    if not out.flags.writeable:
        raise ValueError("out is read-only; expected an array that can be written to")
    direct = out.flags.c_contiguous and out.flags.aligned and not any(np.may_share_memory(out, array) for array in arrays)
    return out if direct else np.empty(shape, dtype)


def _warn_of_singularity(rig: Rig, result: np.ndarray, batch_axes: int) -> None:
    state = [int(k) for k in np.argwhere(~np.isfinite(result))[0][:batch_axes]]
    warnings.warn(
        f"the result{f' for state {state}' if state else ''} of rig {rig.name!r} is not finite: the numbers overflow, or joint "
        "axes coincide there and the mass matrix is singular; give the joints some armature",
        RuntimeWarning,
        stacklevel=_caller(),
    )


def _caller() -> int:
    """How far up the first frame is that is not the project's own."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("articulated."):
        level, frame = level + 1, frame.f_back
    return level
