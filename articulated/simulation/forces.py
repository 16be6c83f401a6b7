"""What acts on a rig during a step, and what it does to a smooth motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from articulated.dynamics.configuration import difference
from articulated.dynamics.forward_dynamics import forward_dynamics
from articulated.dynamics.kinematics import link_velocities
from articulated.dynamics.loops.constrained import Constrained, constrained
from articulated.dynamics.loops.factor import Redundancy
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.passive import passive_forces
from articulated.scalar import Scalar
from articulated.simulation.compliance import compliance
from articulated.simulation.scene import Numbers, Scene


@dataclass(frozen=True, eq=False)
class Forces:
    """What is held constant over a control period.

    Attributes:
        scene: ground, stops and drives.
        tau: generalized forces of the control.
        external: a wrench for each link, (linear, angular) in the world at the link origin, or None.
        gravity: acceleration of free fall.
        numbers: of the scene.
        target: the configuration that drives hold to.
        tables: of each height field.
        towed: what carried particles do to bodies; see `implicit.towing`.
    """

    scene: Scene
    tau: Sequence[Scalar]
    external: Sequence[Sequence[Scalar]] | None
    gravity: Sequence[Scalar]
    numbers: Numbers = field(default_factory=Numbers)
    target: Sequence[Scalar] = ()
    tables: Sequence[Any] = ()
    towed: Sequence[Scalar] = ()

    @property
    def mechanism(self) -> Mechanism:
        return self.scene.mechanism

    @property
    def undriven(self) -> list[Scalar]:
        """The control's forces where no drive acts; elsewhere the drive gives them."""
        driven = self.scene.drives.coordinates if self.scene.drives else ()
        return [0.0 if s in driven else x for s, x in enumerate(self.tau)]

    def errors(self, q: Sequence[Scalar]) -> list[Scalar]:
        """Of each drive, how far its coordinate is from where it should be [rad or m]."""
        if self.scene.drives is None:
            return []
        away = difference(self.mechanism, q, self.target)
        return [away[s] for s in self.scene.drives.coordinates]


@dataclass(frozen=True, eq=False)
class Rate:
    """How velocities change at one moment.

    Attributes:
        a: v̇.
        power: of all forces but weight and those of loops, which do no work.
        pulls: forces of loops, a row each.
        looped: the system that gave them, if there are loops.
    """

    a: list[Scalar]
    power: Scalar
    pulls: list[Scalar]
    looped: Constrained | None


def rate(
    q: Sequence[Scalar], v: Sequence[Scalar], forces: Forces, known: Redundancy | None = None, closing: float = 0.0
) -> Rate:
    """v̇ under these forces, the joints' own damping and friction, what the scene gives, and loops.

    `known`: how rows of loops repeat each other where they are closed, if it is only near there. `closing`: see `constrained`.
    """
    m, loops = forces.mechanism, forces.scene.loops
    given = compliance(forces.scene, forces.numbers, q, v, forces.errors(q), forces.tables)
    tau = [a + b + c for a, b, c in zip(forces.tau, passive_forces(m, v), given.tau, strict=True)]
    power = dot(tau, v) + given.power + external_power(m, q, v, forces)
    if not loops:
        a = forward_dynamics(m, q, v, tau, forces.gravity, forces.external, given.on_bodies)
        return Rate(a, power, given.pulls, None)
    looped = constrained(m, loops, q, v, tau, forces.gravity, forces.external, given.on_bodies, closing, known)
    return Rate(looped.a, power, [*looped.forces, *given.pulls], looped)


def external_power(mechanism: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar], forces: Forces) -> Scalar:
    """The power of the external wrenches."""
    if forces.external is None:
        return 0.0
    twists = link_velocities(mechanism, q, v)
    return sum((dot(wrench, twist) for wrench, twist in zip(forces.external, twists, strict=True)), 0.0)


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Σ a_k b_k."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)
