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
        memory: what the method carries on besides, such as where contacts hold, shape (..., n); see `Simulation.contacts`.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    work: np.ndarray
    memory: np.ndarray
