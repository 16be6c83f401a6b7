"""A recorded motion."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from articulated.rig import Rig
from articulated.trajectory.cloud import Cloud
from articulated.trajectory.motion import Motion
from articulated.trajectory.report import Report, certify

PER_STATE = {
    "q": "T nq",
    "v": "T nv",
    "tau": "T nv",
    "kinetic_energy": "T",
    "potential_energy": "T",
    "work": "T",
    "outcome": "",
    "contact_points": "T n 3",
    "contact_normals": "T n 3",
    "contact_gaps": "T n",
    "contact_forces": "T n 3",
    "loop_gaps": "T m",
    "loop_forces": "T m",
    "residual": "",
}
"""The arrays that each state has its own of, and their shapes."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Frames of a motion, of one state or of a batch whose axes lead.

    Attributes:
        rig: what moves.
        time: of each frame, shape (T,) [s].
        q: configurations, shape (..., T, nq).
        v: generalized velocities, shape (..., T, nv).
        tau: generalized forces of the control from each frame on; of drives, over the step before it; (..., T, nv) [N m, N].
        kinetic_energy, potential_energy: shape (..., T) [J]; of the implicit step the former is that of its velocities where it
            solved for them, one step before the frame.
        work: done since the first frame by all forces but weight, shape (..., T) [J].
        outcome: how the run of each state ended, of `Outcome`, shape (...).
        contact_links: name of the link of each point that could touch the ground, then of each pair of shapes, (n,).
        contact_others: what it could touch, (n,): the name of a link, "scenery", or "" for the ground.
        contact_points: where that was, in the world; of a pair, where it was deepest or nearest, shape (..., T, n, 3) [m].
        contact_normals: of what it could touch, there, towards the link, shape (..., T, n, 3).
        contact_gaps: the distance, negative inside, shape (..., T, n) [m].
        contact_forces: on the link over the step before each frame, in the world, shape (..., T, n, 3) [N].
        loop_rows: a name for each row of each loop, (m,), ropes' last; none if there are no loops.
        loop_gaps: how far they are from closed, shape (..., T, m) [m, or about rad]; a rope's is how much it is too long.
        loop_forces: of loops over the step before each frame (of explicit methods: as it began), on B's link, and their
            opposite on A's, shape (..., T, m) [N, N m]; see `Loop.rows`.
        residual: the largest that the solver left in any step, of each state, shape (...) [m/s].
        settings: how it was made: integrator, dt and so on.
        particles: that the rig carried, of as many frames and states; None if there were none.
    """

    rig: Rig
    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    kinetic_energy: np.ndarray
    potential_energy: np.ndarray
    work: np.ndarray
    outcome: np.ndarray
    settings: dict[str, str | float | int]
    contact_links: tuple[str, ...]
    contact_others: tuple[str, ...]
    contact_points: np.ndarray
    contact_normals: np.ndarray
    contact_gaps: np.ndarray
    contact_forces: np.ndarray
    loop_rows: tuple[str, ...]
    loop_gaps: np.ndarray
    loop_forces: np.ndarray
    residual: np.ndarray
    particles: Cloud | None = None

    def __repr__(self) -> str:
        return f"Trajectory({self.rig.name!r}, {len(self.time)} frames, {self.time[-1]:g} s, states {self.q.shape[:-2]})"

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy, shape (..., T) [J]."""
        return self.kinetic_energy + self.potential_energy

    @property
    def fps(self) -> float:
        """Frames a second; 0 if there is only one."""
        return (len(self.time) - 1) / (self.time[-1] - self.time[0]) if len(self.time) > 1 else 0.0

    @property
    def report(self) -> Report:
        """The certificate of the run."""
        return certify(self)

    def state(self, *index: int) -> Trajectory:
        """The trajectory of one state of a batch, or of part of a batch."""
        if len(index) > self.outcome.ndim:
            raise ValueError(f"state index {index} has {len(index)} entries; the batch has {self.outcome.ndim} axes")
        some: dict[str, Any] = {name: np.asarray(getattr(self, name)[index]) for name in PER_STATE}
        if self.particles is not None:
            some["particles"] = self.particles.state(*index)
        return replace(self, **some)

    def motion(self, fps: float | None = None) -> Motion:
        """Its configurations as a motion, of one state; at another rate if need be.

        Raises:
            ValueError: it is of a batch, has one frame, or holds numbers that are not finite.
        """
        if self.outcome.ndim:
            raise ValueError(f"a batch {self.outcome.shape} is no one motion; take one of its states: run.state(0).motion()")
        motion = Motion(self.rig, self.q, self.fps or 1.0, self.rig.name)
        return motion if fps is None else motion.resampled(fps)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything, the rig included, to an .npz file. An old file is replaced only once the new one is whole.

        Raises:
            ValueError: the name does not end in .npz.
            OSError: the file cannot be written; nothing is left of it then.
        """
        from articulated.trajectory.files import save

        save(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Trajectory:
        """Read a file that `save` wrote.

        Raises:
            ValueError: it is not such a file, or is damaged.
            FileNotFoundError: there is none.
        """
        from articulated.trajectory.files import load

        return load(path)

    def export(self, path: str | os.PathLike[str]) -> None:
        """Write the motion for other programs, in the format that the name ends in: .csv, or .bvh or .glb of one state.

        A .glb (glTF 2.0) has the rig's links as nodes, their shapes, and the motion as an animation.

        Raises:
            ValueError: the format is unknown.
            OSError: the file cannot be written; nothing is left of it then.
        """
        from articulated.trajectory.files import export

        export(self, path)
