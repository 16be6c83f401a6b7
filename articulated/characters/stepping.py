"""Stepping in place: weight goes over one foot, the other is lifted and put down, and so in turn.

The centre of mass sways as that of a linear inverted pendulum whose support goes from foot to foot: c̈ = ω² (c − p), ω² = g/height.
There is one such sway that repeats: c_k = p_k / (1 + (2πk/Tω)²) for each harmonic k. Kajita et al. 2001.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.characters.balance import Stander
from articulated.characters.reaching import path_of, reach
from articulated.dynamics.functions import center_of_mass, link_poses
from articulated.rig import Rig
from articulated.simulation import Command, State
from articulated.trajectory import Motion

_FRAMES = 96
"""Of a cycle."""
_BEGIN = 2
"""Cycles in which it only sways, more and more."""
_SHIFTING = 0.15
"""The part of a cycle in which weight goes from one foot to the other."""
_GRAVITY = 9.81


class Stepper(Stander):
    """Steps in place on two feet, and keeps its balance: a control for a simulation with drives.

        stepper = art.Stepper(rig, pose, feet=["left_foot", "right_foot"], period=1.2, lift=0.06)
        run = simulation.run(pose, duration=30.0, control=stepper)

    Poses are made beforehand, by inverse kinematics of the legs: the centre of mass sways towards a foot as it must to come back,
    and the other foot is lifted. While it runs, these are held, and the centre of mass is kept above the foot that carries; see `Stander`.
    """

    def __init__(
        self,
        rig: Rig,
        pose: ArrayLike,
        feet: Sequence[str],
        *,
        period: float = 1.2,
        lift: float = 0.06,
        stiffness: float = 30.0,
        damping: float = 8.0,
    ):
        """Step like this: a step with each foot in a period [s], `lift` high [m], about a pose in which both feet stand.

        Raises:
            ValueError: as of `Stander`; there are not two feet; the legs cannot reach.
        """
        super().__init__(rig, pose, feet, stiffness=stiffness, damping=damping)
        if len(self.feet) != 2:
            raise ValueError(f"feet names {len(self.feet)} links; stepping takes two")
        if not (0.0 < period < np.inf and 0.0 <= lift < np.inf):
            raise ValueError(f"period is {period!r} and lift is {lift!r}; expected seconds above zero, and metres")
        self.period = period
        self.begin, self.cycle = self._made(lift)

    def shares(self, time: float) -> np.ndarray:
        """How much of the weight each foot carries, shape (2,): all on the first a quarter on, then on the second."""
        first = 0.5 + 0.5 * float(_trapezium(time / self.period))
        return np.array([first, 1.0 - first])

    def __call__(self, time: float, state: State) -> Command:
        """The pose of this moment, and forces besides."""
        motion, t = (
            (self.begin, time) if time < self.begin.duration else (self.cycle, (time - self.begin.duration) % self.period)
        )
        q, v = motion.at(t, loop=motion is self.cycle), motion.velocity(t, loop=motion is self.cycle)
        part = min(time / self.begin.duration, 1.0)
        share = 0.5 + part * (self.shares(t) - 0.5)
        return Command(q, tau=self.balance(state, q, v, share))

    def _made(self, lift: float) -> tuple[Motion, Motion]:
        """How it begins: more and more sway; and a cycle."""
        phase = np.arange(_FRAMES + 1) / _FRAMES
        height = float(center_of_mass(self.rig, self.pose)[2] - self._soles()[:, 2].min())
        p = _trapezium(phase[:-1])
        k = np.fft.rfftfreq(_FRAMES, 1.0 / _FRAMES) * (2.0 * np.pi / self.period)
        sway = np.fft.irfft(np.fft.rfft(p) / (1.0 + k * k * (height / _GRAVITY)), _FRAMES)
        sway = np.append(sway, sway[0])
        # a foot is in the air while it carries next to nothing
        lifts = [lift * _bump((phase - middle + 0.5) % 1.0 - 0.5, 0.5 * (0.5 - _SHIFTING)) for middle in (0.75, 0.25)]
        cycle = self._reached(sway, np.stack(lifts, axis=-1), np.ones(len(phase)))
        cycle[-1] = cycle[0]
        part = np.linspace(0.0, 1.0, _BEGIN * _FRAMES + 1)
        more = np.concatenate([np.tile(sway[:-1], _BEGIN), sway[:1]]) * part
        begin = self._reached(more, np.zeros((len(part), 2)), part)
        rate = _FRAMES / self.period
        return Motion(self.rig, begin, rate, "beginning to step"), Motion(self.rig, cycle, rate, "stepping in place")

    def _soles(self) -> np.ndarray:
        X = link_poses(self.rig, self.pose)
        return np.array([X[f.index, :3, :3] @ p + X[f.index, :3, 3] for f, p in zip(self.feet, self.points, strict=True)])

    def _reached(self, sway: np.ndarray, lifts: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Poses with the centre of mass so far from the middle towards the first foot, and feet lifted, shape (T, nq).

        `part`: how far the centre of mass is on its way from where the pose has it to above the line between the feet.
        """
        rig, soles = self.rig, self._soles()
        root = next((joint for joint in rig.joints.values() if rig.is_root(joint)), None)
        if root is None:
            raise ValueError(f"rig {rig.name!r} is fixed to the world; stepping takes a free root")
        X, targets = link_poses(rig, self.pose), {}
        for foot, up in zip(self.feet, lifts.T, strict=True):
            place = np.tile(X[foot.index], (len(sway), 1, 1))
            place[:, 2, 3] += up
            targets[foot.name] = place
        joints = [name for foot in self.feet for name in path_of(rig, foot.name)]
        q = np.tile(self.pose, (len(sway), 1))
        start, middle, half = center_of_mass(rig, self.pose)[:2], soles.mean(axis=0)[:2], 0.5 * (soles[0] - soles[1])[:2]
        wanted = start + part[:, None] * (middle - start) + sway[:, None] * half
        for _ in range(4):  # the centre of mass follows the root, not quite as far
            q[:, root.q_slice.start : root.q_slice.start + 2] += wanted - center_of_mass(rig, q)[:, :2]
            found = reach(rig, q, targets, joints=joints)
            q = found.q
        if found.distance.max() > 0.01:
            short = f"{1e3 * found.distance.max():.3g} mm"
            raise ValueError(f"the legs do not reach, by {short}; bend the knees of the pose a little, or lift less")
        return q


def _trapezium(phase: np.ndarray | float) -> np.ndarray:
    """Between -1 and 1: up within `_SHIFTING` of a cycle about 0, down about a half, with no corners."""
    u = (np.asarray(phase) + 0.25) % 1.0
    x = np.clip(np.where(u < 0.5, (u - 0.25) / (0.5 * _SHIFTING), (0.75 - u) / (0.5 * _SHIFTING)), -1.0, 1.0)
    return 0.5 * x * (3.0 - x * x)


def _bump(x: np.ndarray, half: float) -> np.ndarray:
    """1 at 0, 0 beyond ±half."""
    s = np.clip(1.0 - (x / half) ** 2, 0.0, 1.0)
    return s * s
