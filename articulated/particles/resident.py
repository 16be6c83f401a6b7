"""Where a state is while machine code has it: laid out as that wants it, from step to step, until somebody looks at it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np


class Laid(ABC):
    """A state, laid out for machine code that takes steps of it.

    Attributes:
        numbers: of the next call: when it begins and how long a step is [s].
    """

    numbers: np.ndarray

    @abstractmethod
    def put(self, system: Any) -> None:
        """Take up the state that a system has."""

    @abstractmethod
    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities, shape (n, 3), new arrays."""

    @abstractmethod
    def take(self, steps: int, threads: int | None) -> tuple[float, int]:
        """Take so many steps: what is left, see `System.step`, and flags of numbers that are not finite."""


class Resident:
    """A state as arrays, or laid out: what was last changed counts.

    Attributes:
        time: [s].
        dtype: of positions and velocities: float64, or float32.
    """

    def __init__(self, x: np.ndarray, v: np.ndarray, time: float):
        self._x, self._v, self.time, self.dtype = x, v, time, x.dtype
        self._room: tuple[Any, Laid] | None = None  # where it was last laid out, and for what
        self._is_laid, self._since = False, time

    def __getstate__(self) -> dict[str, Any]:
        """A copy has a state of its own."""
        self._settle()
        return self.__dict__ | {"_room": None}

    @property
    def x(self) -> np.ndarray:
        self._settle()
        return self._x

    @x.setter
    def x(self, x: np.ndarray) -> None:
        self._settle()
        self._x = np.asarray(x, self.dtype)

    @property
    def v(self) -> np.ndarray:
        self._settle()
        return self._v

    @v.setter
    def v(self, v: np.ndarray) -> None:
        self._settle()
        self._v = np.asarray(v, self.dtype)

    @property
    def single(self) -> bool:
        """Whether it is in float32."""
        return self.dtype == np.float32

    def laid(self, key: Any) -> Laid | None:
        """Where the state is laid out for this, now or the last time; None if it is not."""
        if self._room is None or self._room[0] != key:
            return None
        return self._room[1]

    def go(self, key: Any, laid: Laid, h: float, steps: int, threads: int | None) -> tuple[float, int]:
        """Take steps where the state is laid out; it is there from now on."""
        if not self._is_laid or self._room is None or self._room[1] is not laid:
            self._settle()
            laid.put(self)
            self._room, self._is_laid, self._since = (key, laid), True, self.time
        laid.numbers[:] = self.time, h
        found = laid.take(steps, threads)
        self.time += steps * h
        return found

    def seen(self) -> tuple[np.ndarray, np.ndarray, float]:
        """The last state that there are arrays of."""
        return self._x, self._v, self._since if self._is_laid else self.time

    def back_to(self, seen: tuple[np.ndarray, np.ndarray, float]) -> None:
        """Forget all that came after."""
        self._is_laid = False
        self._x, self._v, self.time = seen

    def _settle(self) -> None:
        if self._is_laid and self._room is not None:
            self._x, self._v = self._room[1].state()
            self._is_laid = False
