"""What a user hands to a run, made into what acts in each control period."""

from __future__ import annotations

from typing import Any

import numpy as np

from articulated.compiler import as_scalars
from articulated.dynamics.boundary import Argument, checked
from articulated.rig import Rig
from articulated.simulation.forces import Forces
from articulated.simulation.state import State


class Schedule:
    """The control and the external wrenches of a run, period by period.

    Attributes:
        tau: the control in force, shape (*batch, nv).
        asks: whether a function has to be asked each period.
        changes: whether anything can change from one period to the next.
    """

    def __init__(
        self,
        rig: Rig,
        batch: tuple[int, ...],
        period: float,
        periods: int,
        control: Any,
        external: Any,
        gravity: tuple[float, float, float],
    ):
        self.rig, self.batch, self.period, self.gravity = rig, batch, period, gravity
        self._control = _Signal(rig, "control", (rig.nv,), batch, periods, control)
        self._external = _Signal(rig, "external", (rig.nlinks, 6), batch, periods, external)
        self.tau = np.zeros((*batch, rig.nv))
        self.asks = self._control.function is not None or self._external.function is not None
        self.changes = self.asks or self._control.over_time is not None or self._external.over_time is not None
        self._forces: Forces | None = None

    def forces(self, k: int, state: State) -> Forces:
        """What acts in period k: the same object as before if it is the same."""
        changed = self._control.update(k, k * self.period, state)
        changed |= self._external.update(k, k * self.period, state)
        if self._forces is None or changed:
            if self._control.value is not None:
                self.tau = self._control.value
            external = self._external.value
            self._forces = Forces(as_scalars(self.tau, 1), None if external is None else as_scalars(external, 2), self.gravity)
        return self._forces


class _Signal:
    """An array, an array over time, a function, or nothing."""

    def __init__(self, rig: Rig, name: str, shape: tuple[int, ...], batch: tuple[int, ...], periods: int, given: Any):
        self.rig, self.name, self.shape, self.batch, self.periods = rig, name, shape, batch, periods
        self.function = given if callable(given) else None
        self.value: np.ndarray | None = None
        self.over_time: np.ndarray | None = None
        self._row = -1
        if given is None or self.function:
            return
        array = checked(rig, Argument(name, given, shape))
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
        self.over_time = np.moveaxis(array, -len(shape) - 1, 0)

    def update(self, k: int, time: float, state: State) -> bool:
        """Find the value in period k; whether it may have changed."""
        if self.function is not None:
            answer = self.function(time, state)
            previous = self.value
            self.value = None if answer is None else self._answer(answer, time)
            if self.value is None and previous is not None:
                self.value = np.zeros_like(previous)
            return True
        if self.over_time is None:
            return False
        row = k * len(self.over_time) // self.periods
        changed, self._row = row != self._row, row
        if changed:
            self.value = self._for_batch(self.over_time[row])
        return changed

    def _answer(self, answer: Any, time: float) -> np.ndarray:
        array = checked(self.rig, Argument(f"{self.name}(t={time:g})", answer, self.shape))
        return self._for_batch(array)

    def _for_batch(self, array: np.ndarray) -> np.ndarray:
        try:
            return np.broadcast_to(array, (*self.batch, *self.shape)).astype(float, copy=False)
        except ValueError:
            wanted = ", ".join(map(str, (*self.batch, *self.shape)))
            raise ValueError(f"{self.name} has shape {array.shape}; it does not broadcast to the states' ({wanted})") from None
