"""Adaptive steps: the method of Dormand and Prince, order 5(4), which takes as many steps as a tolerance needs.

Dormand and Prince 1980, as in Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations (HNW) I, table II.5.2; lengths
of steps by proportional and integral control (Gustafsson 1991; HNW II, IV.2). Differs: errors are measured as vectors,
whichever way axes point, and what counts is the largest: a mean would be watered down by particles that rest.

symbol   meaning
y        positions and velocities, shape (2, n, 3)
k        slopes of y at the seven stages, shape (7, 2, n, 3); the last is the first of the next step
d0, d1   of y, its slope and that slope's: sizes over what is allowed (HNW II.4)
d2
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles.check import positive
from articulated.particles.points import vectors

_A = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_C = (1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
_E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Weights of the difference to the embedded method of order 4."""

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 10.0
_BETA = 0.04
"""The integral part of the control; the proportional part is 1/5 less three quarters of it, as in the authors' DOPRI5."""
_EASY = 1e-4
"""An error less than this part of what is allowed counts as so much, in the step after the next."""
_NONE = 1e-16
_SMALLEST = 4.0
"""A step that moves the time by less than so many of its last digits is too short."""


@dataclass(frozen=True)
class Adaptive:
    """Steps that are as long as errors allow; explicit, so short if forces are stiff.

    Attributes:
        rtol: error of a step that is allowed, as a part of |x| or of |v| of the particle that has it.
        atol: what is allowed besides [m, m/s].
        max_steps: steps tried in one call's h, at most.
        sag: ways that may meet a collider are taken as straight within a step; how far they may bend in it [m].
    """

    rtol: float = 1e-6
    atol: float = 1e-9
    max_steps: int = 10_000
    sag: float = 1e-5

    def __post_init__(self) -> None:
        positive("Adaptive: rtol", self.rtol, zero=True)
        positive("Adaptive: atol", self.atol)
        positive("Adaptive: sag", self.sag)
        if not isinstance(self.max_steps, int) or self.max_steps < 1:
            raise ValueError(f"Adaptive: max_steps is {self.max_steps!r}; expected a whole number, 1 or more")

    def advance(self, system: Any, h: float) -> float:
        """Take a system on by h; returns zero, as no equations are left unsolved.

        Raises:
            ArithmeticError: so many steps were not enough, or steps became too short to go on.
            FloatingPointError: what acts is not finite where it begins.
        """
        start, end = system.time, system.time + h
        y, k = np.stack([system.x, system.v]), np.empty((7, 2, *system.x.shape))
        k[0] = _slope(system, start, y)
        if (lost := np.flatnonzero(~np.isfinite(k[0]).all(axis=(0, 2)))).size:
            raise FloatingPointError(
                f"Adaptive: what acts on particle {lost[0]} at t = {start:g} s is not finite; see which force has no bound"
            )
        length, before, grow, tries = self._first(system, y, k[0], h), _EASY, _GROW, 0
        while (rest := end - system.time) > 0.0:
            too_short = length < min(rest, _SMALLEST * np.spacing(abs(end)))
            if tries == self.max_steps or too_short:
                raise ArithmeticError(
                    f"Adaptive: {tries} steps came to t = {system.time:g} s on the way from {start:g} to {end:g} s, and the "
                    f"next has {length:.3g} s; the system is as it was: if forces are stiff take solver='implicit_euler', if "
                    "they jump or have no bound smoothen them, else allow larger errors or more max_steps"
                )
            # the last step ends exactly there; a rest that would leave a sliver is halved
            taken, tries = rest if length >= rest else min(length, 0.5 * rest), tries + 1
            new = _stages(system, y, k, taken)
            error = self._size(system, taken * np.tensordot(_E, k, 1), y, new)
            straight = self._straight(system, y[0], k, taken) if error <= 1.0 else np.inf
            length = min(taken * _factor(error, before, grow), _SAFETY * straight)
            if error <= 1.0 and taken <= straight:
                system.arrive(taken, *new, 0.0)
                system.time = end if taken == rest else system.time
                y, before, grow = np.stack([system.x, system.v]), max(error, _EASY), _GROW
                k[0] = k[6] if (y == new).all() else _slope(system, system.time, y)
            else:
                grow = 1.0
        return 0.0

    def _first(self, system: Any, y: np.ndarray, slope: np.ndarray, h: float) -> float:
        """Length of the first step (HNW II.4)."""
        d0, d1 = self._size(system, y, y), self._size(system, slope, y)
        guess = min(h, 0.01 * d0 / d1 if d0 > 1e-5 and d1 > 1e-5 else 1e-6)
        change = _slope(system, system.time + guess, y + guess * slope) - slope
        steep = max(d1, self._size(system, change, y) / guess)
        # no steepness at all, or one that overflows, says nothing
        tried = (0.01 / steep) ** 0.2 if 1e-15 < steep < np.inf else max(1e-6, 1e-3 * guess)
        return min(100.0 * guess, tried, h)

    def _size(self, system: Any, e: np.ndarray, *ys: np.ndarray) -> float:
        """The largest |e| of all that is free, over what is allowed of y."""
        ratio = np.linalg.norm(e, axis=-1) / (self.atol + self.rtol * np.linalg.norm(ys, axis=-1).max(axis=0))
        return float(ratio[:, system.inverse_mass > 0.0].max(initial=0.0))

    def _straight(self, system: Any, x: np.ndarray, k: np.ndarray, h: float) -> float:
        """How long a step may be that no way bends too far, of those that may meet something within h: |a| h²/8 ≤ sag."""
        speed, a = np.linalg.norm(k, axis=-1).max(axis=0)
        near = np.zeros(len(x), dtype=bool)
        for collider in system.colliders:
            gap, _ = collider.gap(system.time, vectors(x))
            surface = collider.velocity(system.time, vectors(x))
            near |= gap <= h * (speed + np.sqrt(surface.dot(surface)))
        steepest = a[near & (system.inverse_mass > 0.0)].max(initial=0.0)
        return float(np.sqrt(8.0 * self.sag / steepest)) if steepest > 0.0 else np.inf


def _slope(system: Any, t: float, y: np.ndarray) -> np.ndarray:
    return np.stack([y[1], system.acceleration(t, *y)])


def _stages(system: Any, y: np.ndarray, k: np.ndarray, h: float) -> np.ndarray:
    """Where a step leads whose first slope is known; fills in the others."""
    there = y
    for n, (row, c) in enumerate(zip(_A, _C, strict=True), 1):
        there = y + h * np.tensordot(row, k[:n], 1)
        k[n] = _slope(system, system.time + c * h, there)
    return there


def _factor(error: float, before: float, grow: float) -> float:
    """How much longer the next step is, after this error and the one before it, over what is allowed (HNW II, 2.43c)."""
    if not np.isfinite(error):
        return _SHRINK
    if error > 1.0:
        return max(_SAFETY * error**-0.2, _SHRINK)
    return min(max(_SAFETY * max(error, _NONE) ** (0.75 * _BETA - 0.2) * before**_BETA, _SHRINK), grow)
