"""Assembly: from a configuration with open loops to one with closed loops, by continuation and damped least squares.

The gaps of the guess are closed little by little, φ(q) = (1 − s) φ(q_guess) with s from 0 to 1, so that each step starts near
its end and the branch stays that of the guess: a knee bends the way that it bends there. A step is a Levenberg-Marquardt
solution with coordinates held to their limits (those at a limit that would go beyond are left out); if it fails, s takes a
shorter one. From a guess that is symmetric, or stretched, rounding decides which way limbs go, and one way may end at limits:
so what fails tries again from beside the guess.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import Argument, checked
from articulated.dynamics.functions import integrate
from articulated.dynamics.loops.closure import closures
from articulated.dynamics.loops.functions import Loops, gaps, jacobians, own_loops
from articulated.rig import Rig

CLOSED = 1e-12
"""Gaps that count as closed [m, rad]."""
_FIRST, _SHORTEST = 0.25, 1e-3
_ITERATIONS = 60
_DAMPING = 1e-6
"""Of the first try of each step, over the mean square of the Jacobian's columns."""
_FARTHEST = 0.3
"""No coordinate goes farther in a step [rad, m]: near a singular place it would go anywhere."""
_BESIDE = (1e-9, 1e-9, 1e-6, 1e-6, 1e-3, 1e-3, 0.01, 0.01, 0.1, 0.1)
"""How far beside the guess further tries begin [rad, m]."""
_NEAR = 1e-3
"""A step may end so much farther away, over its own length, than where it was to go; then it is only refined at the end."""


class AssemblyError(ValueError):
    """Loops that cannot close.

    Attributes:
        q: the configuration that comes nearest, shape (nq,).
        gaps: what is left open there, shape (m,).
    """

    def __init__(self, message: str, q: np.ndarray, gaps: np.ndarray):
        super().__init__(message)
        self.q, self.gaps = q, gaps


def assemble(
    rig: Rig, loops: Loops = None, q_guess: ArrayLike | None = None, hold: Sequence[str] = (), limits: bool = True
) -> np.ndarray:
    """A configuration with closed loops near a guess, on its branch.

    Args:
        rig: the rig.
        loops: what is to be closed, ropes too; None for the rig's own.
        q_guess: where to start, shape (..., nq); None is the neutral configuration.
        hold: names of joints that stay as they are in the guess, such as the one that will be driven.
        limits: whether joints stay within their limits.

    Returns:
        Configurations, shape (..., nq), with gaps of at most 1e-12 m or rad, but for rounding.

    Raises:
        AssemblyError: loops cannot close: by how much, where, and which joints were at their limits.
        ValueError: a loop or the guess does not fit the rig, or a joint is unknown.
    """
    guess = checked(rig, Argument("q_guess", rig.neutral() if q_guess is None else q_guess, (rig.nq,), role="q")).astype(float)
    free = np.ones(rig.nv, dtype=bool)
    for name in [hold] if isinstance(hold, str) else hold:
        if name not in rig.joints:
            raise ValueError(f"hold: rig {rig.name!r} has no moving joint {name!r}")
        free[rig.joints[name].v_slice] = False
    problem = _Problem(rig, loops, free, limits)
    result = np.empty_like(guess)
    for index in np.ndindex(guess.shape[:-1]):
        result[index] = problem.solve(guess[index], index)
    return result


class _Problem:
    """Gaps to close by some coordinates within their limits."""

    def __init__(self, rig: Rig, loops: Loops, free: np.ndarray, limits: bool):
        self.rig, self.free = rig, free
        self.loops = closures(rig, own_loops(rig, loops))
        self.rows = [label for loop in self.loops for label in loop.labels]
        self.ropes = np.array([loop.one_sided for loop in self.loops for _ in loop.labels], dtype=bool)
        self.at = np.full(rig.nv, -1)
        for joint in rig.joints.values():
            if joint.nq == joint.nv and joint.kind != "planar":
                self.at[joint.v_slice] = np.arange(joint.q_slice.start, joint.q_slice.stop)
        self.bounded = (self.at >= 0) & limits
        self.lower, self.upper = rig.lower, rig.upper

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """φ, with what a slack rope lacks counted as closed."""
        open_ = gaps(self.rig, self.loops, q, None)
        return np.where(self.ropes, np.maximum(open_, 0.0), open_)

    def solve(self, guess: np.ndarray, index: tuple[int, ...]) -> np.ndarray:
        """A configuration with closed loops, from the guess or from beside it.

        Raises:
            AssemblyError: no try led to one; it tells of the one that came nearest.
        """
        rng, nearest = np.random.default_rng(0), None
        for far in (0.0, *_BESIDE):
            start = integrate(self.rig, guess, far * self.free * rng.normal(size=self.rig.nv))
            q, closes = self._continued(start if far else guess)
            if closes:
                return q
            if nearest is None or np.linalg.norm(self.gaps(q)) < np.linalg.norm(self.gaps(nearest)):
                nearest = q
        assert nearest is not None
        raise self._failure(nearest, index)

    def _continued(self, guess: np.ndarray) -> tuple[np.ndarray, bool]:
        """Where continuation from a guess ends, and whether loops are closed there."""
        q = self._within(guess)
        start = self.gaps(q)
        s, ds = 0.0, _FIRST
        while s < 1.0 and np.abs(start).max(initial=0.0) > CLOSED:
            aim = min(1.0, s + ds)
            wanted = (1.0 - aim) * start
            tried = self._descend(q, wanted)
            missed = np.linalg.norm(self.gaps(tried) - wanted)
            if missed <= (CLOSED if aim == 1.0 else _NEAR * (aim - s) * np.linalg.norm(start)) * max(1.0, len(start)):
                q, s, ds = tried, aim, 2.0 * ds
            elif ds > _SHORTEST:
                ds *= 0.25
            else:  # no way through: what is nearest to here may be closed all the same
                q = self._descend(tried, np.zeros(len(start)))
                return q, bool(np.abs(self.gaps(q)).max() <= CLOSED)
        return q, True

    def _descend(self, q: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Levenberg-Marquardt, Nocedal and Wright, Numerical Optimization, 10.3, with an active set of limits."""
        error = self.gaps(q) - wanted
        damping, cost = _DAMPING, float(error @ error)
        for _ in range(_ITERATIONS):
            if cost <= (0.1 * CLOSED) ** 2:
                break
            J = np.where(self.ropes[:, None] & (error <= 0.0)[:, None], 0.0, jacobians(self.rig, self.loops, q, None))
            moved = self._step(q, J, error, damping)
            moved *= min(1.0, _FARTHEST / max(np.abs(moved).max(initial=0.0), 1e-30))
            new = self._within(integrate(self.rig, q, moved))
            new_error = self.gaps(new) - wanted
            new_cost = float(new_error @ new_error)
            if new_cost < cost:
                small = new_cost > 0.999999 * cost
                q, error, cost, damping = new, new_error, new_cost, max(damping * 0.1, 1e-14)
                if small and damping <= _DAMPING:
                    break
            elif damping > 1e6:
                break
            else:
                damping = max(damping * 10.0, 1e-10)
        return q

    def _step(self, q: np.ndarray, J: np.ndarray, error: np.ndarray, damping: float) -> np.ndarray:
        """The damped step of the free coordinates; those that it takes beyond a limit stay there, and the others try again."""
        free, step = self.free.copy(), np.zeros(self.rig.nv)
        size = damping * (J * J).mean() * self.rig.nv if J.size else 1.0
        while free.any():
            A = J[:, free]
            step = np.zeros(self.rig.nv)
            step[free] = -A.T @ np.linalg.lstsq(A @ A.T + size * np.eye(len(error)), error, rcond=None)[0]
            beyond = free & self._beyond(q, step)
            if not beyond.any():
                break
            free &= ~beyond
        return step

    def _beyond(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Which coordinates are at a limit and would go on beyond it."""
        at = q[np.maximum(self.at, 0)]
        return self.bounded & (((at >= self.upper) & (step > 0.0)) | ((at <= self.lower) & (step < 0.0)))

    def _within(self, q: np.ndarray) -> np.ndarray:
        q = q.copy()
        some = self.bounded & self.free
        q[self.at[some]] = np.clip(q[self.at[some]], self.lower[some], self.upper[some])
        return q

    def _failure(self, q: np.ndarray, index: tuple[int, ...]) -> AssemblyError:
        left = self.gaps(q)
        worst = [k for k in np.argsort(-np.abs(left)) if abs(left[k]) > 1e-9][:6]
        at = q[np.maximum(self.at, 0)]
        stuck = self.bounded & ((at >= self.upper) | (at <= self.lower))
        names = [name for name, held in zip(self.rig.v_names, stuck, strict=True) if held]
        open_ = ", ".join(f"{self.rows[k]} by {abs(left[k]):.3g}" for k in worst)
        state = f" in state {list(index)}" if index else ""
        limits = f"; at their limits: {', '.join(names)}" if names else "; no joint is at a limit"
        return AssemblyError(
            f"loops of rig {self.rig.name!r} cannot close{state} from this guess: open are {open_} (m or rad){limits};"
            " give another guess, hold fewer joints, or correct the loops",
            q,
            left,
        )
