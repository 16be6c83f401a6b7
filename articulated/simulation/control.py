"""What a user hands to a run, made into what acts in each control period."""

from __future__ import annotations

from typing import Any

import numpy as np

from articulated.dynamics.boundary import Argument, checked
from articulated.rig import Rig
from articulated.simulation.state import State


class Signal:
    """An array, an array over time, a function, or nothing.

    Attributes:
        function: to be asked each period, if it is one.
        value: what holds in the period that was last updated to, of the batch's shape; None for nothing.
        over_time: shape (..., N, *shape), its N rows sharing the run evenly, if it is one.
        turns: for each period its row.
    """

    def __init__(
        self, rig: Rig, name: str, shape: tuple[int, ...], batch: tuple[int, ...], periods: int, given: Any, dtype: np.dtype
    ):
        self.rig, self.name, self.shape, self.batch, self.dtype = rig, name, shape, batch, dtype
        self.function = given if callable(given) else None
        self.value: np.ndarray | None = None
        self.over_time: np.ndarray | None = None
        self.turns = np.zeros(periods, dtype=np.int64)
        if given is None or self.function:
            return
        array = checked(rig, Argument(name, given, shape)).astype(dtype, copy=False)
        if array.ndim - len(shape) <= len(batch):
            self.value = self._for_batch(array)
            return
        rows = array.shape[-len(shape) - 1]
        if array.ndim - len(shape) > len(batch) + 1 or not 0 < rows <= periods:
            wanted = ", ".join(map(str, shape))
            raise ValueError(
                f"{name} has shape {array.shape}; expected (..., {wanted}) with at most {len(batch)} leading axes, or one more"
                f" for time, of 1 to {periods} rows (the run has that many control periods)"
            )
        self._for_batch(array[..., 0, *[slice(None)] * len(shape)])
        self.over_time = array
        self.turns = np.arange(periods, dtype=np.int64) * rows // periods

    @property
    def changes(self) -> bool:
        """Whether it may change from one period to the next."""
        return self.function is not None or self.over_time is not None

    def update(self, k: int, time: float, state: State) -> None:
        """Find the value in period k."""
        if self.function is not None:
            answer = self.function(time, state)
            self.value = None if answer is None else self._answer(answer, time)
        elif self.over_time is not None:
            self.value = self.rows(np.array([k]))[..., 0, *[slice(None)] * len(self.shape)]

    def rows(self, periods: np.ndarray) -> np.ndarray:
        """What holds in some periods, shape (*batch, len(periods), *shape); a signal that is an array only."""
        if self.over_time is not None:
            chosen = np.take(self.over_time, self.turns[periods], axis=-len(self.shape) - 1)
        elif self.value is not None:
            chosen = np.expand_dims(self.value, -len(self.shape) - 1)
        else:
            chosen = np.zeros((1,) * (1 + len(self.shape)), self.dtype)
        return np.broadcast_to(chosen, (*self.batch, len(periods), *self.shape))

    def _answer(self, answer: Any, time: float) -> np.ndarray:
        return self._for_batch(checked(self.rig, Argument(f"{self.name}(t={time:g})", answer, self.shape)))

    def _for_batch(self, array: np.ndarray) -> np.ndarray:
        try:
            return np.broadcast_to(array, (*self.batch, *self.shape)).astype(self.dtype, copy=False)
        except ValueError:
            wanted = ", ".join(map(str, (*self.batch, *self.shape)))
            raise ValueError(f"{self.name} has shape {array.shape}; it does not broadcast to the states' ({wanted})") from None
