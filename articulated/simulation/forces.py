"""What acts on a rig during a step, and what it does to the motion: acceleration and power."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.dynamics.forward_dynamics import forward_dynamics
from articulated.dynamics.kinematics import link_velocities
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.passive import passive_forces
from articulated.scalar import Scalar


@dataclass(frozen=True, eq=False)
class Forces:
    """What is held constant over a control period.

    Attributes:
        tau: generalized forces of the control.
        external: a wrench for each link, (linear, angular) in the world at the link origin, or None.
        gravity: acceleration of free fall.
    """

    tau: Sequence[Scalar]
    external: Sequence[Sequence[Scalar]] | None
    gravity: Sequence[Scalar]


def acceleration_and_power(
    mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar], forces: Forces
) -> tuple[list[Scalar], Scalar]:
    """v̇ under these forces and the joints' own damping and friction; and the power of all of them but weight."""
    tau = [a + b for a, b in zip(forces.tau, passive_forces(mechanism, v), strict=True)]
    a = forward_dynamics(mechanism, q, v, tau, forces.gravity, forces.external)
    return a, dot(tau, v) + external_power(mechanism, q, v, forces)


def external_power(mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar], forces: Forces) -> Scalar:
    """The power of the external wrenches."""
    if forces.external is None:
        return 0.0
    twists = link_velocities(mechanism, q, v)
    return sum((dot(wrench, twist) for wrench, twist in zip(forces.external, twists, strict=True)), 0.0)


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Σ a_k b_k."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)
