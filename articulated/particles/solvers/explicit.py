"""Explicit methods: what acts is computed from where particles are.

Runge-Kutta methods of orders 1, 2 and 4, and the semi-implicit Euler method, which takes the new velocities for the way.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

State = tuple[np.ndarray, np.ndarray]
"""Positions and velocities, each of shape (n, 3)."""
Accelerations = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


def euler(a: Accelerations, t: float, h: float, x: np.ndarray, v: np.ndarray) -> State:
    """Order 1: both go on as they are now."""
    return x + h * v, v + h * a(t, x, v)


def semi_implicit(a: Accelerations, t: float, h: float, x: np.ndarray, v: np.ndarray) -> State:
    """Order 1, symplectic: positions go on with the new velocities."""
    v = v + h * a(t, x, v)
    return x + h * v, v


def midpoint(a: Accelerations, t: float, h: float, x: np.ndarray, v: np.ndarray) -> State:
    """Order 2."""
    half = 0.5 * h
    there, then = x + half * v, v + half * a(t, x, v)
    return x + h * then, v + h * a(t + half, there, then)


def rk4(a: Accelerations, t: float, h: float, x: np.ndarray, v: np.ndarray) -> State:
    """Order 4, Kutta's."""
    half = 0.5 * h
    v1, a1 = v, a(t, x, v)
    v2 = v + half * a1
    a2 = a(t + half, x + half * v1, v2)
    v3 = v + half * a2
    a3 = a(t + half, x + half * v2, v3)
    v4 = v + h * a3
    a4 = a(t + h, x + h * v3, v4)
    return x + h / 6.0 * (v1 + 2.0 * (v2 + v3) + v4), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)


LAGS = {"euler": -0.5, "semi_implicit": 0.5, "midpoint": 0.0, "rk4": 0.0}
"""By how much of a step the velocities of each belong to an earlier moment than its positions."""

EXPLICIT = {"euler": euler, "semi_implicit": semi_implicit, "midpoint": midpoint, "rk4": rk4}
