"""Forces that joints bring with them: viscous damping and dry friction."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar, is_zero, sqrt

FRICTION_SLIP = 1e-2
"""Velocity about which dry friction turns from sticking to sliding [rad/s or m/s]: it is a smooth law."""


def resistance(mechanism: Mechanism, v: Sequence[Scalar]) -> list[Scalar]:
    """r(v), the force against each coordinate's velocity, over that velocity: damping + friction / √(v² + ε²)."""
    result: list[Scalar] = []
    for damping, friction, x in zip(mechanism.damping, mechanism.friction, v, strict=True):
        dry = 0.0 if is_zero(friction) else friction / sqrt(x * x + FRICTION_SLIP * FRICTION_SLIP)
        result.append(damping + dry)
    return result


def passive_forces(mechanism: Mechanism, v: Sequence[Scalar]) -> list[Scalar]:
    """−r(v) v."""
    return [-(r * x) for r, x in zip(resistance(mechanism, v), v, strict=True)]
