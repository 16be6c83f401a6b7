"""Kinetic energy as the implicit step has it: of its velocities where it solved for them, a step before where they led."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from articulated.dynamics.boundary import Argument
from articulated.dynamics.calls import call
from articulated.dynamics.configuration import integrate
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.tree import in_world, tree
from articulated.rig import Rig
from articulated.scalar import Scalar


def solved_kinetic_energy(rig: Rig, q: np.ndarray, v: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Of states that steps led to, shape (...) [J].

    Args:
        rig: the rig.
        q, v: states, shapes (..., nq) and (..., nv).
        h: length of the step before, shape (...) [s]; 0 where there was none.
    """
    given = [Argument("q", q, (rig.nq,)), Argument("v", v, (rig.nv,)), Argument("h", h, ())]
    return call(rig, _energy, given, (), None, None, watched=False)


def _energy(m: Mechanism, q: Sequence[Scalar], v: Sequence[Scalar], h: Scalar) -> Scalar:
    now, before = tree(m, q), tree(m, integrate(m, q, [-(h * x) for x in v]))
    V = before.velocities(in_world(now, v) if m.nbodies else v)
    return sum((0.5 * V[i].dot(before.inertia(i) @ V[i]) for i in range(m.nbodies)), 0.0) + _of_rotors(m, v)


def _of_rotors(m: Mechanism, v: Sequence[Scalar]) -> Scalar:
    return sum((0.5 * a * x * x for a, x in zip(m.armature, v, strict=True)), 0.0)
