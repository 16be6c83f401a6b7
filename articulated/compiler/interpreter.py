"""Algorithms over scalars, run on numpy arrays whose leading axes are a batch of states.

One state runs on Python floats, which are several times faster than numpy's; a batch runs on one array for each scalar.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence

import numpy as np

from articulated.scalar import Nested, flatten


def evaluate(
    algorithm: Callable[..., Nested],
    arguments: Sequence[tuple[np.ndarray | None, int]],
    result: np.ndarray,
    batch: tuple[int, ...],
) -> None:
    """Run an algorithm on every state of a batch.

    Args:
        algorithm: takes one nested list of scalars for each argument, and returns one.
        arguments: arrays with the number of their last axes that belong to one state; the others broadcast to `batch`. None is
            passed on.
        result: where the outcome goes, shape (*batch, *shape of one outcome).
        batch: the leading axes.
    """
    values = result.reshape(*batch, -1)  # a view: callers give contiguous results
    scalars = [None if array is None else as_scalars(array, core) for array, core in arguments]
    with np.errstate(all="ignore"):
        for k, x in enumerate(flatten(algorithm(*scalars))):
            values[..., k] = x


def as_scalars(array: np.ndarray, core: int) -> Nested:
    """The last `core` axes as nested lists: of floats for one state in float64, else of an array for each scalar."""
    if array.ndim == core and array.dtype == np.float64:
        return array.tolist()
    if core == 0:
        return np.ascontiguousarray(array)
    return [as_scalars(array[(..., k, *[slice(None)] * (core - 1))], core - 1) for k in range(array.shape[-core])]


def interpreting() -> bool:
    """Whether the user asked for it: ARTICULATED_INTERPRET=1."""
    return os.environ.get("ARTICULATED_INTERPRET", "") not in ("", "0")
