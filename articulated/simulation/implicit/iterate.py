"""What the solver of a step carries from sweep to sweep."""

from __future__ import annotations

from dataclasses import dataclass

from articulated.scalar import Scalar
from articulated.simulation.implicit.values import Values


@dataclass(frozen=True, eq=False)
class Iterate:
    """What the solver carries from sweep to sweep.

    Attributes:
        k: how many sweeps so far.
        v: velocities of the coordinates that move with the load.
        pulls: impulses of loops with which A v − p = −Jᵀ y, too.
        u, y: velocities and impulses of the terms.
        limits: of the contacts' friction cones.
        error: Σ ‖g(u) − y‖², weighted, over the rig's mass [m²/s²].
        left: r, what the linear system was left unsolved by, if it was solved by iteration: A v − p = −Jᵀ y − r.
        slack: √(rᵀ T⁻¹ r), with T as in `conjugate`.
    """

    k: Scalar
    v: list[Scalar]
    pulls: list[Scalar]
    u: Values
    y: Values
    limits: list[Scalar]
    error: Scalar
    left: list[Scalar]
    slack: Scalar
