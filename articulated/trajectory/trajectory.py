"""A recorded motion."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from articulated.rig import Rig
from articulated.trajectory.report import Report, certify


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Frames of a motion, of one state or of a batch whose axes lead.

    Attributes:
        rig: what moves.
        time: of each frame, shape (T,) [s].
        q: configurations, shape (..., T, nq).
        v: generalized velocities, shape (..., T, nv).
        tau: generalized forces of the control from each frame on, shape (..., T, nv) [N m, N].
        kinetic_energy, potential_energy: shape (..., T) [J].
        work: done since the first frame by all forces but weight, shape (..., T) [J].
        outcome: how the run of each state ended, of `Outcome`, shape (...).
        settings: how it was made: integrator, dt and so on.
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
        return certify(self.rig, self.q, self.kinetic_energy, self.potential_energy, self.work, self.outcome)

    def state(self, *index: int) -> Trajectory:
        """The trajectory of one state of a batch, or of part of a batch."""
        if len(index) > self.outcome.ndim:
            raise ValueError(f"state index {index} has {len(index)} entries; the batch has {self.outcome.ndim} axes")
        part = {name: getattr(self, name)[index] for name in ("q", "v", "tau", "kinetic_energy", "potential_energy", "work")}
        return Trajectory(rig=self.rig, time=self.time, outcome=np.asarray(self.outcome[index]), settings=self.settings, **part)

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
        """Write the motion for other programs, in the format that the name ends in: .csv.

        Raises:
            ValueError: the format is unknown.
            OSError: the file cannot be written; nothing is left of it then.
        """
        from articulated.trajectory.files import export

        export(self, path)
