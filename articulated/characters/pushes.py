"""Pushes on links, each for a while: a queue that a run reads as external wrenches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import find_link
from articulated.dynamics.functions import link_poses
from articulated.rig import Rig
from articulated.simulation import State


@dataclass(frozen=True, eq=False)
class Push:
    """A force on a point of a link, for a while.

    Attributes:
        link: index of the link.
        force: in the world, shape (..., 3) [N].
        point: in the link frame, shape (3,) [m].
        start, end: when [s].
    """

    link: int
    force: np.ndarray
    point: np.ndarray
    start: float
    end: float


class Pushes:
    """Pushes that wait for their time; give it to a run, or to steps, as `external`.

        pushes = art.Pushes(rig)
        pushes.add("torso", (300.0, 0.0, 0.0), start=2.0, duration=0.1)
        run = simulation.run(q0, duration=5.0, external=pushes)

    More may be added while it runs.
    """

    def __init__(self, rig: Rig):
        """None yet."""
        self.rig = rig
        self._waiting: list[Push] = []

    def add(
        self, link: str, force: ArrayLike, start: float = 0.0, duration: float = 0.1, point: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> None:
        """Add one.

        Args:
            link: its name.
            force: in the world, shape (3,), or (..., 3) for a batch [N].
            start, duration: [s]; it acts in the control periods that begin within.
            point: where it pushes, in the link frame [m].

        Raises:
            ValueError: the link is unknown, or a number is not finite.
        """
        force, point_ = np.asarray(force, dtype=float), np.asarray(point, dtype=float)
        if force.ndim == 0 or force.shape[-1] != 3 or not np.isfinite(force).all():
            raise ValueError(f"force of a push is {force.tolist()}; expected finite numbers, shape (..., 3)")
        if point_.shape != (3,) or not np.isfinite(point_).all():
            raise ValueError(f"point of a push is {point!r}; expected three finite numbers")
        if not (math.isfinite(start) and math.isfinite(duration) and duration > 0.0):
            raise ValueError(f"a push from {start!r} s on for {duration!r} s; expected finite times, the second above zero")
        self._waiting.append(Push(find_link(self.rig, link).index, force, point_, float(start), float(start + duration)))

    def __call__(self, time: float, state: State) -> np.ndarray | None:
        """The wrenches of those whose time it is, (force, couple) in the world at link origins; None if it is nobody's."""
        now = [push for push in self._waiting if push.start - 1e-9 <= time < push.end - 1e-9]
        if not now:
            return None
        batch = np.broadcast_shapes(state.q.shape[:-1], *(push.force.shape[:-1] for push in now))
        wrenches = np.zeros((*batch, self.rig.nlinks, 6))
        R = link_poses(self.rig, state.q)[..., :3, :3] if any(push.point.any() for push in now) else None
        for push in now:
            wrenches[..., push.link, :3] += push.force
            if R is not None:
                wrenches[..., push.link, 3:] += np.cross(R[..., push.link, :, :] @ push.point, push.force)
        return wrenches
