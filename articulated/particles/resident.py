"""Where a state is while machine code has it: laid out as that wants it, from step to step, until somebody looks at it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np


class Laid(Protocol):
    """A state, laid out.

    Attributes:
        key: for what machine code.
    """

    key: Any

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities, shape (n, 3), new arrays."""
        ...


class Resident:
    """A state as arrays, or laid out: what was last changed counts.

    Attributes:
        time: [s].
        dtype: of positions and velocities: float64, or float32.
    """

    def __init__(self, x: np.ndarray, v: np.ndarray, time: float):
        self._x, self._v, self.time, self.dtype = x, v, time, x.dtype
        self._laid: Laid | None = None
        self._since = time

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

    def laid(self, key: Any) -> Any:
        """The state as it is laid out for this machine code; None if it is not."""
        return self._laid if self._laid is not None and self._laid.key == key else None

    def lay(self, laid: Laid, time: float) -> None:
        """The state is there from now on."""
        if self._laid is not laid:
            self._settle()
            self._laid, self._since = laid, self.time
        self.time = time

    def seen(self) -> tuple[np.ndarray, np.ndarray, float]:
        """The last state that there are arrays of."""
        return self._x, self._v, self.time if self._laid is None else self._since

    def back_to(self, seen: tuple[np.ndarray, np.ndarray, float]) -> None:
        """Forget all that came after."""
        self._laid = None
        self._x, self._v, self.time = seen

    def _settle(self) -> None:
        if self._laid is not None:
            self._x, self._v = self._laid.state()
            self._laid = None
