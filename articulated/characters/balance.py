"""Standing: a pose held by drives, and the centre of mass held above the feet by what legs can push.

A force wanted on the centre of mass is asked of the joints between it and the feet: Jᵀ F, J the Jacobian of the centre of mass
relative to the feet: virtual model control, Pratt et al. 2001. Differs: drives hold the pose besides, in the same solve.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import Argument, checked, find_link
from articulated.dynamics.functions import center_of_mass, jacobian, link_poses, momentum
from articulated.rig import Rig
from articulated.simulation import Command, State


class Stander:
    """Holds a pose and its balance: a control for a simulation with drives.

        stander = art.Stander(rig, pose, feet=["left_foot", "right_foot"])
        run = simulation.run(pose, duration=30.0, control=stander, external=pushes)

    Attributes:
        rig, pose, feet: what stands, how, and on what.
        stiffness, damping: of the centre of mass against its place above the feet, over the mass [1/s²], [1/s].
        points: of each foot, in its own frame, what it stands on the middle of, shape (n, 3) [m].
    """

    def __init__(self, rig: Rig, pose: ArrayLike, feet: Sequence[str], *, stiffness: float = 30.0, damping: float = 8.0):
        """Stand like this.

        Raises:
            ValueError: a foot is unknown, a number negative, or the pose does not fit.
        """
        self.rig = rig
        self.pose = np.asarray(checked(rig, Argument("pose", pose, (rig.nq,), role="q")), dtype=float)
        self.feet = [find_link(rig, foot) for foot in feet]
        if not self.feet:
            raise ValueError("feet names no link; expected one at least, such as ['left_foot', 'right_foot']")
        for name, value in (("stiffness", stiffness), ("damping", damping)):
            if not 0.0 <= value < np.inf:
                raise ValueError(f"{name} is {value!r}; expected a finite number, zero or more")
        self.stiffness, self.damping = stiffness, damping
        self.points = np.array([_sole(rig, foot.name) for foot in self.feet])

    def __call__(self, time: float, state: State) -> Command:
        """The pose, and forces besides."""
        return Command(self.pose, tau=self.balance(state, self.pose, np.zeros(self.rig.nv), np.ones(len(self.feet))))

    def balance(self, state: State, q: np.ndarray, v: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Joint forces that bring the centre of mass where a pose has it, seen from the feet that carry, shape (..., nv) [N m].

        Args:
            state: now.
            q, v: the pose, and how fast it changes, shapes (nq,) and (nv,).
            share: of each foot, how much it carries, shape (n,).
        """
        rig, weights = self.rig, share / share.sum()
        place, rate, _ = self._above(q, v, weights)
        here, speed, J = self._above(state.q, state.v, weights)
        force = np.zeros((*state.q.shape[:-1], 3))
        force[..., :2] = rig.mass * (self.stiffness * (place - here) + self.damping * (rate - speed))
        tau = np.einsum("...ij,...i->...j", J, force)
        for joint in rig.joints.values():
            if rig.is_root(joint):
                tau[..., joint.v_slice] = 0.0  # that is the ground's part
        return tau

    def _above(self, q: np.ndarray, v: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The centre of mass from the middle of the feet, how fast it moves, both in x and y, and its Jacobian in all three."""
        X = link_poses(self.rig, q)
        place, J = center_of_mass(self.rig, q), center_jacobian(self.rig, q)
        for foot, point, w in zip(self.feet, self.points, weights, strict=True):
            place = place - w * (X[..., foot.index, :3, :3] @ point + X[..., foot.index, :3, 3])
            J = J - w * jacobian(self.rig, q, foot.name, point=point)[..., :3, :]
        return place[..., :2], np.einsum("...ij,...j->...i", J, v)[..., :2], J


def center_jacobian(rig: Rig, q: np.ndarray) -> np.ndarray:
    """How coordinates move the centre of mass, in the world, shape (..., 3, nv)."""
    linear, _ = np.split(np.asarray(momentum(rig, q[..., None, :], np.eye(rig.nv))), 2, axis=-1)
    unit = linear / rig.mass
    return np.swapaxes(unit, -1, -2)


def _sole(rig: Rig, foot: str) -> np.ndarray:
    """The middle of a foot's shapes, in its frame [m]."""
    shapes = rig.links[foot].collisions
    return np.mean([shape.pose[:3, 3] for shape in shapes], axis=0) if shapes else np.zeros(3)
