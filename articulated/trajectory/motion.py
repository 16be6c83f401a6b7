"""A motion: what a rig is to do, frame by frame; from motion capture, from a run, or made."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import Argument, checked
from articulated.dynamics.functions import difference, integrate
from articulated.rig import Rig
from articulated.rig.skeleton import Skeleton
from articulated.trajectory.interpolation import between, rates


@dataclass(frozen=True, eq=False)
class Motion:
    """Configurations of a rig at a steady rate.

        motion = art.Motion(rig, q, fps=120.0)
        motion.at(0.3), motion.velocity(0.3), motion.resampled(30.0).export("walk.csv")

    Attributes:
        rig: what moves.
        q: configurations, shape (T, nq), two frames at least; quaternions of either sign.
        fps: frames a second.
        name: what it is called.
        skeleton: that of the BVH file that it came from, to be written as it was read; None if it did not.
        v: generalized velocities of the frames, by central differences on the manifold, shape (T, nv).

    Raises:
        ValueError: q has another shape, is not finite, or holds quaternions that are none; fps is no positive number.
    """

    rig: Rig
    q: np.ndarray
    fps: float
    name: str = ""
    skeleton: Skeleton | None = field(default=None, repr=False)
    v: np.ndarray = field(init=False)

    def __post_init__(self):
        if not isinstance(self.fps, (int, float, np.number)) or not 0.0 < self.fps < math.inf:
            raise ValueError(f"fps is {self.fps!r}; expected a positive number of frames a second")
        q = checked(self.rig, Argument("q", self.q, (self.rig.nq,))).astype(float)
        if q.ndim != 2 or len(q) < 2:
            raise ValueError(f"q has shape {q.shape}; expected (T, {self.rig.nq}), two frames at least")
        q = checked(self.rig, Argument("q", q, (self.rig.nq,), role="q")).astype(float)
        for where in self.rig.quaternions.values():
            dots = np.sum(q[1:, where] * q[:-1, where], axis=-1)
            q[1:, where] *= np.where(np.cumsum(dots < 0.0) % 2, -1.0, 1.0)[:, None]
        q.flags.writeable = False
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "fps", float(self.fps))
        object.__setattr__(self, "v", rates(self.rig, q, 1.0 / self.fps))

    def __repr__(self) -> str:
        return f"Motion({self.name or self.rig.name!r}, {len(self.q)} frames, {self.fps:g} fps, {self.duration:g} s)"

    @property
    def duration(self) -> float:
        """From the first frame to the last [s]."""
        return (len(self.q) - 1) / self.fps

    @property
    def time(self) -> np.ndarray:
        """Of each frame, shape (T,) [s]."""
        return np.arange(len(self.q)) / self.fps

    def at(self, time: ArrayLike, *, loop: bool = False) -> np.ndarray:
        """Configurations at times, shape (..., nq): between frames a cubic on the manifold, beyond the ends theirs.

        Args:
            time: shape (...) [s].
            loop: begin anew after the last frame.
        """
        return between(self.rig, self.q, self.v, 1.0 / self.fps, self._place(time, loop))[0]

    def velocity(self, time: ArrayLike, *, loop: bool = False) -> np.ndarray:
        """Generalized velocities at times, likewise, shape (..., nv); zero beyond the ends."""
        v = between(self.rig, self.q, self.v, 1.0 / self.fps, self._place(time, loop))[1]
        t = np.asarray(time, dtype=float)[..., None]
        return v if loop else np.where((t < 0.0) | (t > self.duration), 0.0, v)

    def resampled(self, fps: float) -> Motion:
        """The same motion at another rate, as far as whole frames go."""
        if not isinstance(fps, (int, float, np.number)) or not 0.0 < fps < math.inf:
            raise ValueError(f"fps is {fps!r}; expected a positive number of frames a second")
        frames = math.floor(self.duration * fps + 1e-9) + 1
        if frames < 2:
            raise ValueError(f"a motion of {self.duration:g} s has no two frames at {fps:g} fps; give more")
        return replace(self, q=self.at(np.arange(frames) / fps), fps=fps)

    def part(self, start: float = 0.0, end: float = math.inf) -> Motion:
        """The frames from one time to another [s]."""
        time = self.time
        some = (time >= start - 1e-9) & (time <= end + 1e-9)
        if some.sum() < 2:
            raise ValueError(f"from {start:g} s to {end:g} s there are {some.sum()} frames; it lasts {self.duration:g} s")
        return replace(self, q=self.q[some])

    def filtered(self, cutoff: float) -> Motion:
        """Without what is faster than `cutoff` [Hz]: Butterworth's second order, once forwards and once backwards.

        Turns are filtered as rotation vectors, about quaternions that were filtered number by number.

        Raises:
            ValueError: `cutoff` is not between 0 and half the rate, or there are too few frames.
        """
        if not 0.0 < cutoff < 0.5 * self.fps:
            raise ValueError(f"cutoff is {cutoff!r} Hz; expected more than 0, and less than half of {self.fps:g} fps")
        from scipy.signal import butter

        sos = np.asarray(butter(2, cutoff, fs=self.fps, output="sos"))
        if len(self.q) < 10:
            raise ValueError(f"{len(self.q)} frames are too few to filter; expected 10 at least")
        base = _through(sos, self.q)
        for where in self.rig.quaternions.values():
            base[:, where] /= np.linalg.norm(base[:, where], axis=-1, keepdims=True)
        return replace(self, q=integrate(self.rig, base, _through(sos, difference(self.rig, base, self.q))))

    def export(self, path: str | os.PathLike[str], *, fps: float | None = None) -> None:
        """Write it for other programs; see `Trajectory.export` for formats."""
        from articulated.trajectory.files import export_motion

        export_motion(self if fps is None else self.resampled(fps), path)

    def _place(self, time: Any, loop: bool) -> np.ndarray:
        place = np.asarray(time, dtype=float) * self.fps
        if np.isnan(place).any():
            raise ValueError("time holds NaN; expected seconds")
        last = len(self.q) - 1.0
        return place % last if loop else np.clip(place, 0.0, last)


def _through(sos: np.ndarray, values: np.ndarray) -> np.ndarray:
    from scipy.signal import sosfiltfilt  # it takes a while

    return sosfiltfilt(sos, values, axis=0, padlen=min(len(values) - 1, 15))
