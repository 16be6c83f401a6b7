"""Steps on the configuration manifold, joint by joint."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar


def integrate(mechanism: Mechanism, q: Sequence[Scalar], dv: Sequence[Scalar]) -> list[Scalar]:
    """q ⊕ dv: where q is after unit time at the constant generalized velocity dv."""
    result: list[Scalar] = []
    for joint in mechanism.own_joints():
        result += joint.model.integrate(joint.configuration(q), joint.velocity(dv))
    return result


def difference(mechanism: Mechanism, q0: Sequence[Scalar], q1: Sequence[Scalar]) -> list[Scalar]:
    """The smallest dv with q0 ⊕ dv = q1."""
    result: list[Scalar] = []
    for joint in mechanism.own_joints():
        result += joint.model.difference(joint.configuration(q0), joint.configuration(q1))
    return result


def configuration_rate(mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar]) -> list[Scalar]:
    """q̇."""
    result: list[Scalar] = []
    for joint in mechanism.own_joints():
        result += joint.model.rate(joint.configuration(q), joint.velocity(v))
    return result


def step_rate(mechanism: Mechanism, step: Sequence[Scalar], v: Sequence[Scalar]) -> list[Scalar]:
    """The rate of `step` that makes q0 ⊕ step move with velocity v: dexp⁻¹, cut after the fourth bracket.

    v + ½[s, v] + ¹⁄₁₂[s,[s, v]] − ¹⁄₇₂₀[s,[s,[s,[s, v]]]]: Hairer, Lubich, Wanner, Geometric Numerical Integration, III.4
    eq. 4.11, with signs for velocities in the body. Enough for methods of order 5, whose steps are O(h).
    """
    result: list[Scalar] = []
    for joint in mechanism.own_joints():
        s, rate, bracket = joint.velocity(step), joint.velocity(v), joint.model.bracket
        first = bracket(s, rate)
        second = bracket(s, first)
        fourth = bracket(s, bracket(s, second))
        result += [
            x + 0.5 * b1 + (1.0 / 12.0) * b2 - (1.0 / 720.0) * b4
            for x, b1, b2, b4 in zip(rate, first, second, fourth, strict=True)
        ]
    return result
