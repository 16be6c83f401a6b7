"""One moment of a simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class State:
    """One moment of one state or of a batch.

    Attributes:
        time: since the start [s].
        q: configurations, shape (..., nq).
        v: generalized velocities, shape (..., nv).
        work: done since the start by all forces but weight, shape (...) [J].
        particles: that the rig carries: x, then v, shape (..., n, 6) [m, m/s]; None if it carries none.
        memory: what the method carries on besides, such as where contacts hold, shape (..., n); see `Simulation.contacts`.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    work: np.ndarray
    memory: np.ndarray
    particles: np.ndarray | None = None

    @staticmethod
    def of(time: float, motion: np.ndarray, nq: int, nv: int) -> State:
        """The state that an array of all its numbers holds, shape (..., nq + nv + 1 + n): views of it."""
        end = nq + nv
        return State(time, motion[..., :nq], motion[..., nq:end], motion[..., end], motion[..., end + 1 :])

    def motion(self) -> np.ndarray:
        """All its numbers in one array: that of which they are views, if they are."""
        parts, base = (self.q, self.v, self.work[..., None], self.memory), self.q.base
        size = sum(part.shape[-1] for part in parts)
        if isinstance(base, np.ndarray) and base.shape == (*self.work.shape, size) and base.flags.c_contiguous:
            same = State.of(self.time, base, self.q.shape[-1], self.v.shape[-1])
            if all(_is_same(getattr(self, name), getattr(same, name)) for name in ("q", "v", "work", "memory")):
                return base
        return np.concatenate(parts, axis=-1)


def _is_same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two arrays are the same numbers in memory."""
    return a.size == 0 or a.__array_interface__ == b.__array_interface__
