"""Stepping in place: weight goes over one foot, the other is lifted and put down, and so in turn."""

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
_SHIFTING = 0.22
"""The part of a cycle in which weight goes from one foot to the other."""


class Stepper(Stander):
    """Steps in place on two feet, and keeps its balance: a control for a simulation with drives.

        stepper = art.Stepper(rig, pose, feet=["left_foot", "right_foot"], period=2.0, lift=0.06)
        run = simulation.run(pose, duration=30.0, control=stepper)

    One cycle of poses is made beforehand, by inverse kinematics of the legs: the centre of mass goes over a foot, the other is
    lifted. While it runs, these are held, and the centre of mass is kept above the foot that carries; see `Stander`.
    """

    def __init__(
        self,
        rig: Rig,
        pose: ArrayLike,
        feet: Sequence[str],
        *,
        period: float = 2.0,
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
        self.cycle = self._made(lift)

    def shares(self, time: float) -> np.ndarray:
        """How much of the weight each foot carries, shape (2,): all on the first a quarter on, then on the second."""
        left = 0.5 + 0.5 * _trapezium(time / self.period)
        return np.array([left, 1.0 - left])

    def __call__(self, time: float, state: State) -> Command:
        """The pose of this moment, and forces besides."""
        ahead = time % self.period
        return Command(self.cycle.at(ahead, loop=True), tau=self.balance(state, self.shares(time)))

    def _made(self, lift: float) -> Motion:
        rig, phase = self.rig, np.arange(_FRAMES + 1) / _FRAMES
        X = link_poses(rig, self.pose)
        soles = np.array([X[f.index, :3, :3] @ p + X[f.index, :3, 3] for f, p in zip(self.feet, self.points, strict=True)])
        shares = np.array([self.shares(u * self.period) for u in phase])
        targets = {}
        for k, foot in enumerate(self.feet):
            place = np.tile(X[foot.index], (len(phase), 1, 1))
            # a foot is in the air while it carries next to nothing
            place[:, 2, 3] += lift * _bump((phase - (0.75 if k == 0 else 0.25) + 0.5) % 1.0 - 0.5, 0.5 * (0.5 - _SHIFTING))
            targets[foot.name] = place
        joints = [name for foot in self.feet for name in path_of(rig, foot.name)]
        root = next((joint for joint in rig.joints.values() if rig.is_root(joint)), None)
        if root is None:
            raise ValueError(f"rig {rig.name!r} is fixed to the world; stepping takes a free root")
        q = np.tile(self.pose, (len(phase), 1))
        for _ in range(4):  # the centre of mass follows the root, not quite as far
            off = (shares @ soles)[:, :2] - center_of_mass(rig, q)[:, :2]
            q[:, root.q_slice.start : root.q_slice.start + 2] += off
            found = reach(rig, q, targets, joints=joints)
            q = found.q
        if found.distance.max() > 0.01:
            short = f"{1e3 * found.distance.max():.3g} mm"
            raise ValueError(f"the legs do not reach, by {short}; bend the knees of the pose a little, or lift less")
        q[-1] = q[0]
        return Motion(rig, q, _FRAMES / self.period, "stepping in place")


def _trapezium(phase: np.ndarray | float) -> np.ndarray:
    """Between -1 and 1: up within `_SHIFTING` of a cycle about 0, down about a half, with no corners."""
    u = (np.asarray(phase) + 0.25) % 1.0
    x = np.clip(np.where(u < 0.5, (u - 0.25) / (0.5 * _SHIFTING), (0.75 - u) / (0.5 * _SHIFTING)), -1.0, 1.0)
    return 0.5 * x * (3.0 - x * x)


def _bump(x: np.ndarray, half: float) -> np.ndarray:
    """1 at 0, 0 beyond ±half."""
    s = np.clip(1.0 - (x / half) ** 2, 0.0, 1.0)
    return s * s
