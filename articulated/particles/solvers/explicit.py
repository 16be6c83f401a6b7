"""Explicit methods: what acts is computed from where particles are.

Runge-Kutta methods of orders 1, 2 and 4, and the semi-implicit Euler method, which takes the new velocities for the way. They
are written for anything that can be added and scaled: arrays of all particles, or vectors over scalars of one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Accelerations = Callable[[Any, Any, Any], Any]
"""From time, positions and velocities."""


def euler(a: Accelerations, t: Any, h: Any, x: Any, v: Any) -> tuple[Any, Any]:
    """Order 1: both go on as they are now."""
    return x + v * h, v + a(t, x, v) * h


def semi_implicit(a: Accelerations, t: Any, h: Any, x: Any, v: Any) -> tuple[Any, Any]:
    """Order 1, symplectic: positions go on with the new velocities."""
    v = v + a(t, x, v) * h
    return x + v * h, v


def midpoint(a: Accelerations, t: Any, h: Any, x: Any, v: Any) -> tuple[Any, Any]:
    """Order 2."""
    half = h * 0.5
    there, then = x + v * half, v + a(t, x, v) * half
    return x + then * h, v + a(t + half, there, then) * h


def rk4(a: Accelerations, t: Any, h: Any, x: Any, v: Any) -> tuple[Any, Any]:
    """Order 4, Kutta's."""
    half, sixth = h * 0.5, h * (1.0 / 6.0)
    v1, a1 = v, a(t, x, v)
    v2 = v + a1 * half
    a2 = a(t + half, x + v1 * half, v2)
    v3 = v + a2 * half
    a3 = a(t + half, x + v2 * half, v3)
    v4 = v + a3 * h
    a4 = a(t + h, x + v3 * h, v4)
    return x + (v1 + (v2 + v3) * 2.0 + v4) * sixth, v + (a1 + (a2 + a3) * 2.0 + a4) * sixth


EXPLICIT = {"euler": euler, "semi_implicit": semi_implicit, "midpoint": midpoint, "rk4": rk4}
LAGS = {"euler": -0.5, "semi_implicit": 0.5, "midpoint": 0.0, "rk4": 0.0}
"""By how much of a step the velocities of each belong to an earlier moment than its positions."""
