"""Semi-implicit (symplectic) Euler: velocity first, then position with the new velocity. Order 1.

Joint damping and dry friction are implicit, (M + h R) a = τ − C − R v with R the resistance at v, so that no stiffness of
theirs limits the step: in the articulated-body sweep, R h adds to the armature.
"""

from __future__ import annotations

from articulated.dynamics.configuration import integrate
from articulated.dynamics.forward_dynamics import forward_dynamics
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.passive import resistance
from articulated.scalar import Scalar
from articulated.simulation.forces import Forces, dot, external_power
from articulated.simulation.runge_kutta import Point


def semi_implicit_step(mechanism: Mechanism, start: Point, forces: Forces, h: Scalar) -> Point:
    """One step of length h."""
    q, v = start.q, start.v
    R = resistance(mechanism, v)
    tau = [t - r * x for t, r, x in zip(forces.tau, R, v, strict=True)]
    armature = [m + h * r for m, r in zip(mechanism.armature, R, strict=True)]
    a = forward_dynamics(mechanism, q, v, tau, forces.gravity, forces.external, armature)

    v_new = [x + h * y for x, y in zip(v, a, strict=True)]
    q_new = integrate(mechanism, q, [h * x for x in v_new])

    # force times mean velocity is the change of kinetic energy exactly, for a constant mass matrix
    mean = [0.5 * (x + y) for x, y in zip(v, v_new, strict=True)]
    acting = [t - r * x for t, r, x in zip(forces.tau, R, v_new, strict=True)]
    work = start.work + h * (dot(acting, mean) + external_power(mechanism, q, mean, forces))
    return Point(q_new, v_new, work)
