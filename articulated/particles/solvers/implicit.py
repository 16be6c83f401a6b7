"""Implicit Euler: what acts is that at the end of the step, so that no stiffness makes it blow up.

The new velocity is where r(v) = M (v − v₀) − h f(x₀ + h v, v) vanishes. Of forces with an energy this is where
½ |v − v₀|²_M + V(x₀ + h v) has its least value. It is found by Newton's method, with A = M + h D + h² K made positive
semidefinite, and conjugate gradients for A δ = −r, preconditioned by the blocks of A's diagonal (Baraff and Witkin, Large Steps
in Cloth Simulation, 1998, equation 16, is its first turn from v₀ = 0). Differs: it turns until little changes, and no turn goes
farther than r gets smaller in its own direction. Of chains, A δ = −r is solved exactly (see `chains`). A step that is not
solved, or which turns springs that are pressed, might gain energy: it is brought nearer to one that moves all as a whole, which
cannot.

symbol   meaning
r, δ     residual [N s], what a turn adds to the velocities [m/s]
z, p     residual after the preconditioner, direction of conjugate gradients
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles import strands, woven
from articulated.particles.chains import band
from articulated.particles.sums import acting, are_summed

_SEARCHES = 10
"""How often a turn, or a step, is halved."""
_ROUNDING = 1e-14
"""A part of the energy that is no gain."""


@dataclass(frozen=True)
class ImplicitEuler:
    """How implicit steps are solved.

    Attributes:
        turns: of Newton's method, at most. One is the linear step of the paper, the fast one: nothing is searched, and energy
            may rise where springs turn or are pressed.
        iterations: of conjugate gradients in each.
        tolerance: a step is solved once a turn changes velocities by less than this: √(−r · δ) over the total mass [m/s].
    """

    turns: int = 8
    iterations: int = 60
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        for name in ("turns", "iterations"):
            if not isinstance(getattr(self, name), int) or getattr(self, name) < 1:
                raise ValueError(f"ImplicitEuler: {name} is {getattr(self, name)!r}; expected a whole number, 1 or more")
        if not self.tolerance >= 0.0:
            raise ValueError(f"ImplicitEuler: tolerance is {self.tolerance!r}; expected a number, zero or more")

    def step(self, system: Any, h: float) -> tuple[np.ndarray, np.ndarray, float]:
        """The new positions and velocities of a system, and by how much the last turn changed these, see `tolerance`."""
        acts = acting(system)
        t, x0, v0, m, w = system.time + h, system.x, system.v, system.mass[:, None], system.inverse_mass[:, None]

        def residual(v: np.ndarray) -> np.ndarray:
            return (m * (v - v0) - h * acts.force(t, x0 + h * v, v)) * (w > 0.0)

        v, size = v0.copy(), 0.0
        r = residual(v)
        for _ in range(self.turns):
            change, left = self._solved(system, t, h, x0 + h * v, v, r)
            if self.turns == 1:
                return x0 + h * (v + change), v + change, left
            size = float(np.sqrt(max(0.0, -float(np.vdot(r, change))) / max(system.mass.sum(), np.finfo(float).tiny)))
            v, r = _searched(residual, v, r, change)
            if size <= self.tolerance:
                break
        v = _without_gain(system, acts, t, h, x0, v)
        return x0 + h * v, v, size

    def _solved(self, system: Any, t: float, h: float, x: np.ndarray, v: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, float]:
        """The δ of a turn, and what is left of its equation [m/s]."""
        m, free = system.mass[:, None], system.inverse_mass[:, None] > 0.0
        if strands.are_strands(system):
            return strands.turn(system, h, v), 0.0
        if system.chains is None and are_summed(system):
            return woven.turn(system, h, v, self.iterations)
        if system.chains is not None:
            blocks = band(system, t, x, v, h)
            blocks[:, 0] += m[:, :, None] * np.eye(3)
            return system.chains.solve(blocks, -r, ~free[:, 0]), 0.0

        def product(p: np.ndarray) -> np.ndarray:
            return (m * p + system.product(t, x, v, p, h)) * free

        blocks = system.diagonal(t, x, v, h) + np.where(free, m, 1.0)[:, :, None] * np.eye(3)
        change, square = conjugate_gradients(product, -r, np.linalg.inv(blocks), self.iterations)
        return change, float(np.sqrt(square / max(system.mass.sum(), np.finfo(float).tiny)))


def conjugate_gradients(
    product: Callable[[np.ndarray], np.ndarray], b: np.ndarray, inverses: np.ndarray, iterations: int
) -> tuple[np.ndarray, float]:
    """A solution of A x = b, as near as so many iterations come, and rᵀ z of what is left.

    Golub and Van Loan, Matrix Computations (2013), algorithm 11.5.1, preconditioned by 3x3 blocks.

    Args:
        product: A times a vector, shape (n, 3).
        b: shape (n, 3).
        inverses: of the blocks on A's diagonal, shape (n, 3, 3).
        iterations: how many.
    """
    x, r = np.zeros_like(b), b
    z = np.einsum("nij,nj->ni", inverses, r)
    p, rz = z, float(np.vdot(r, z))
    end = 1e-28 * rz
    for _ in range(iterations):
        if rz <= end:
            break
        Ap = product(p)
        alpha = rz / float(np.vdot(p, Ap))
        x, r = x + alpha * p, r - alpha * Ap
        z = np.einsum("nij,nj->ni", inverses, r)
        rz, before = float(np.vdot(r, z)), rz
        p = z + (rz / before) * p
    return x, rz


def _searched(
    residual: Callable[[np.ndarray], np.ndarray], v: np.ndarray, r: np.ndarray, change: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As far along a change as the residual along it, which begins below zero, does not rise far above."""
    slope, step = float(np.vdot(r, change)), 1.0
    new = residual(v + change)
    for _ in range(_SEARCHES):
        if float(np.vdot(new, change)) <= 0.9 * abs(slope):
            break
        step *= 0.5
        new = residual(v + step * change)
    return v + step * change, new


def _without_gain(system: Any, acts: Any, t: float, h: float, x0: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocities with which a step gains no more energy than drag and wind do work in it."""
    free = system.inverse_mass[:, None] > 0.0
    whole = np.zeros(3) if not free.all() else system.mass @ v / system.mass.sum()
    before, own, share = acts.energy(system.time, x0, system.v), v - whole * free, 1.0
    allowed = _ROUNDING * abs(before)
    for _ in range(_SEARCHES):
        x = x0 + h * v
        if not acts.energy(t, x, v) > before + h * acts.power(t, x, v) + allowed:
            return v  # what is no number is not hidden
        share *= 0.5
        v = whole * free + own * share
    return whole * free
