"""Recorded particles."""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

FORMAT = 1
"""Version of the .npz layout."""

_ARRAYS = ("time", "x", "v", "energy", "segments", "triangles")


@dataclass(frozen=True, eq=False)
class Cloud:
    """Frames of particles, of one state or of a batch whose axes lead.

    Attributes:
        time: of each frame, shape (T,) [s].
        x: positions in the world, shape (..., T, n, 3) [m].
        v: velocities, shape (..., T, n, 3) [m/s].
        energy: kinetic, and potential of all forces that have one, shape (..., T) [J].
        segments: pairs of particles that something joins, to be drawn, shape (m, 2).
        triangles: between which particles there is cloth, to be drawn, shape (k, 3).
    """

    time: np.ndarray
    x: np.ndarray
    v: np.ndarray
    energy: np.ndarray
    segments: np.ndarray
    triangles: np.ndarray

    def __repr__(self) -> str:
        batch = self.x.shape[:-3]
        return f"Cloud({self.x.shape[-2]} particles, {len(self.time)} frames, {np.ptp(self.time):g} s, states {batch})"

    @property
    def fps(self) -> float:
        """Frames a second; 0 if there is only one."""
        return (len(self.time) - 1) / (self.time[-1] - self.time[0]) if len(self.time) > 1 else 0.0

    def state(self, *index: int) -> Cloud:
        """Of one state of a batch, or of part of a batch."""
        if len(index) > self.x.ndim - 3:
            raise ValueError(f"state index {index} has {len(index)} entries; the batch has {self.x.ndim - 3} axes")
        return replace(self, **{name: np.asarray(getattr(self, name)[index]) for name in ("x", "v", "energy")})

    def arrays(self) -> dict[str, np.ndarray]:
        """All of it, by name."""
        return {name: getattr(self, name) for name in _ARRAYS}

    @staticmethod
    def of(arrays: dict[str, np.ndarray]) -> Cloud:
        """The reverse of `arrays`.

        Raises:
            KeyError: one is missing.
            ValueError: they do not belong together.
        """
        cloud = Cloud(**{name: arrays[name] for name in _ARRAYS})
        shape = cloud.x.shape
        if cloud.time.ndim != 1 or cloud.x.ndim < 3 or shape[-3] != len(cloud.time) or shape[-1] != 3:
            raise ValueError(f"x has shape {shape}")
        if cloud.v.shape != shape or cloud.energy.shape != shape[:-2]:
            raise ValueError(f"v has shape {cloud.v.shape}, energy {cloud.energy.shape}")
        for some, size in ((cloud.segments, 2), (cloud.triangles, 3)):
            if some.ndim != 2 or some.shape[1] != size or (some.size and not 0 <= some.min() <= some.max() < shape[-2]):
                raise ValueError(f"segments or triangles have shape {some.shape}")
        return cloud

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to an .npz file. An old file is replaced only once the new one is whole.

        Raises:
            ValueError: the name does not end in .npz.
            OSError: the file cannot be written; nothing is left of it then.
        """
        from articulated.trajectory.files import written

        if Path(path).suffix != ".npz":
            raise ValueError(f"{os.fspath(path)!r} does not end in .npz; use export for other formats")
        with written(path, "wb") as file:
            arrays: dict[str, Any] = self.arrays()
            np.savez_compressed(file, about=json.dumps({"format": FORMAT, "kind": "cloud"}), **arrays)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Cloud:
        """Read a file that `save` wrote.

        Raises:
            ValueError: it is not such a file, or is damaged.
            FileNotFoundError: there is none.
        """
        name = os.fspath(path)
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
                about = json.loads(str(data["about"]))
                if about.get("kind") != "cloud":
                    raise ValueError("it holds something else")
                if about["format"] > FORMAT:
                    raise ValueError(f"format {about['format']}; this version reads up to {FORMAT}: update articulated")
                return Cloud.of({key: data[key] for key in _ARRAYS})
        except FileNotFoundError:
            raise
        except (OSError, EOFError, KeyError, AttributeError, TypeError, ValueError, zipfile.BadZipFile, zlib.error) as error:
            raise ValueError(f"{name} holds no particles, or is damaged ({type(error).__name__}: {error})") from None

    def export(self, path: str | os.PathLike[str]) -> None:
        """Write the motion for other programs, in the format that the name ends in: .csv, a row for each frame and particle.

        Raises:
            ValueError: the format is unknown.
            OSError: the file cannot be written; nothing is left of it then.
        """
        from articulated.trajectory.files import written

        if Path(path).suffix.lower() != ".csv":
            raise ValueError(f"{os.fspath(path)!r}: unknown format {Path(path).suffix!r}; known are .csv and save's .npz")
        batch = self.x.shape[:-3]
        with written(path, "w") as file:
            file.write(",".join([*(f"state{k}" for k in range(len(batch))), "time,particle,x,y,z,vx,vy,vz"]) + "\n")
            for state in np.ndindex(batch):
                prefix = "".join(f"{k}," for k in state)
                for t, x, v in zip(self.time.tolist(), self.x[state], self.v[state], strict=True):
                    for k, row in enumerate(np.hstack([x, v]).tolist()):
                        file.write(f"{prefix}{t!r},{k},{','.join(map(repr, row))}\n")
