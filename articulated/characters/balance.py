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
        return Command(self.pose, tau=self.balance(state, np.ones(len(self.feet))))

    def balance(self, state: State, share: np.ndarray) -> np.ndarray:
        """Joint forces that bring the centre of mass above the middle of the feet that carry, shape (..., nv) [N m].

        Args:
            state: now.
            share: of each foot, how much it carries, shape (n,).
        """
        rig, q, v = self.rig, state.q, state.v
        X = link_poses(rig, q)
        soles = [(X[..., f.index, :3, :3] @ p) + X[..., f.index, :3, 3] for f, p in zip(self.feet, self.points, strict=True)]
        weights = share / share.sum()
        middle = sum(w * sole for w, sole in zip(weights, soles, strict=True))
        error = center_of_mass(rig, q)[..., :2] - middle[..., :2]
        J = center_jacobian(rig, q)
        speed = (J @ v[..., None])[..., 0]
        force = np.zeros((*q.shape[:-1], 3))
        force[..., :2] = -rig.mass * (self.stiffness * error + self.damping * speed[..., :2])
        tau = np.zeros((*q.shape[:-1], rig.nv))
        for foot, point, w in zip(self.feet, self.points, weights, strict=True):
            relative = J - jacobian(rig, q, foot.name, point=point)[..., :3, :]
            tau += w * np.einsum("...ij,...i->...j", relative, force)
        for joint in rig.joints.values():
            if rig.is_root(joint):
                tau[..., joint.v_slice] = 0.0  # that is the ground's part
        return tau


def center_jacobian(rig: Rig, q: np.ndarray) -> np.ndarray:
    """How coordinates move the centre of mass, in the world, shape (..., 3, nv)."""
    unit = momentum(rig, q[..., None, :], np.eye(rig.nv))[..., :3] / rig.mass
    return np.swapaxes(unit, -1, -2)


def _sole(rig: Rig, foot: str) -> np.ndarray:
    """The middle of a foot's shapes, in its frame [m]."""
    shapes = rig.links[foot].collisions
    return np.mean([shape.pose[:3, 3] for shape in shapes], axis=0) if shapes else np.zeros(3)
