"""What users give is checked here, before anything acts on particles: what is wrong is said with its name and its place."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import Any

import numpy as np


def numbers(name: str, value: Any, shape: tuple[int | None, ...], finite: bool = True) -> np.ndarray:
    """An array of such a shape, None standing for any length.

    Raises:
        ValueError: it is none, or an entry is not finite.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r}; expected numbers, shape {_shape(shape)}") from None
    if array.ndim != len(shape) or any(b not in (None, a) for a, b in zip(array.shape, shape, strict=True)):
        raise ValueError(f"{name} has shape {array.shape}; expected {_shape(shape)}")
    wrong = ~np.isfinite(array) if finite else np.isnan(array)
    if wrong.any():
        where = tuple(int(k) for k in np.argwhere(wrong)[0])
        raise ValueError(f"{name}{list(where) if where else ''} is {array[where]}; every entry must be finite")
    return array


def format_of(*given: Any) -> np.dtype:
    """Float32 if all arrays that are given, at least one, are of it, else float64; numbers alone, and None, do not count."""
    arrays = [value for value in given if np.ndim(value)]
    return np.dtype(np.float32 if all(getattr(value, "dtype", None) == np.float32 for value in arrays) else np.float64)


def vector(name: str, value: Any) -> np.ndarray:
    """Three finite numbers."""
    return numbers(name, value, (3,))


def positive(name: str, value: Any, zero: bool = False) -> float:
    """A finite number above zero, or zero too.

    Raises:
        ValueError: it is not.
    """
    number = value if isinstance(value, float) and isfinite(value) else float(numbers(name, value, ()))
    if number < 0.0 or (number == 0.0 and not zero):
        raise ValueError(f"{name} is {number:g}; expected a number above zero{', or zero' if zero else ''}")
    return number


def per_element(name: str, value: Any, count: int | None = None, kind: str = "particle", low: float = 0.0) -> np.ndarray:
    """A number for all of some things, or one for each; not less than `low`.

    Args:
        name: what to call it.
        value: shape () or (count,).
        count: None is any.
        kind: what there are so many of.
        low: the least that makes sense.

    Raises:
        ValueError: it is none of these.
    """
    array = numbers(name, value, () if np.ndim(value) == 0 else (None,))
    if array.ndim and count not in (None, len(array)):
        raise ValueError(f"{name} has {len(array)} entries; expected one number, or one for each {kind}: {count}")
    if (array < low).any():
        where = int(np.argmin(array))
        place = f"[{where}]" if array.ndim else ""
        raise ValueError(f"{name}{place} is {array.flat[where]:g}; expected {low:g} or more")
    return array


def elements(name: str, value: Any, size: int) -> np.ndarray:
    """Numbers of particles, so many for each element, shape (m, size).

    Raises:
        ValueError: they are no such integers, or an element has a particle twice.
    """
    array = np.array(value)
    if array.size == 0:
        return np.zeros((0, size), dtype=np.int64)
    if array.dtype.kind not in "iu" or array.ndim != 2 or array.shape[1] != size:
        raise ValueError(f"{name} has shape {array.shape} of {array.dtype}; expected integers, shape (m, {size})")
    if (array < 0).any():
        where = tuple(int(k) for k in np.argwhere(array < 0)[0])
        raise ValueError(f"{name}{list(where)} is {array[where]}; particles are counted from 0")
    ordered = np.sort(array, axis=1)
    twice = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if twice.any():
        where = int(np.argmax(twice))
        raise ValueError(f"{name}[{where}] is {array[where].tolist()}; expected {size} particles that are not the same")
    return array.astype(np.int64)


def in_range(name: str, array: np.ndarray, count: int) -> None:
    """That there are particles of these numbers.

    Raises:
        ValueError: there are not.
    """
    if array.size and array.max() >= count:
        where = tuple(int(k) for k in np.argwhere(array >= count)[0])
        raise ValueError(f"{name}{list(where)} is {array[where]}; there are {count} particles, the last is {count - 1}")


def at_least_two(name: str, value: Any) -> int:
    """A whole number, 2 or more.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, (int, np.integer)) or value < 2:
        raise ValueError(f"{name} is {value!r}; expected a whole number, 2 or more")
    return int(value)


def mask(name: str, value: Any, n: int) -> np.ndarray:
    """Which of n particles, from their numbers or a mask.

    Raises:
        ValueError: it is neither.
    """
    array = np.asarray(value)
    if array.dtype == bool:
        if array.shape != (n,):
            raise ValueError(f"{name} is a mask of shape {array.shape}; expected ({n},)")
        return array
    some = elements(name, array.reshape(-1, 1), 1)
    in_range(name, some, n)
    result = np.zeros(n, dtype=bool)
    result[some[:, 0]] = True
    return result


def all_are(kind: type, name: str, things: Iterable[Any], some: str) -> None:
    """That all things are of a kind, such as `some`.

    Raises:
        ValueError: one is not.
    """
    for thing in things:
        if not isinstance(thing, kind):
            raise ValueError(f"{name} holds {thing!r}; expected {some} and the like")


def settle(thing: Any, **values: Any) -> None:
    """Put what was checked in the place of what a frozen description was given."""
    for name, value in values.items():
        object.__setattr__(thing, name, value)


def _shape(shape: tuple[int | None, ...]) -> str:
    names = iter("nmk")
    parts = ", ".join(str(next(names) if size is None else size) for size in shape)
    return f"({parts},)" if len(shape) == 1 else f"({parts})"
