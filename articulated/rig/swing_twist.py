"""How far a ball joint may go: an elliptic cone for the direction of one axis, and a range for turns about that axis.

A turn R of the child is a twist about the axis a, then the shortest swing that takes a to R a. The swing is described by its
tilt: two angles, how far a has tipped towards u, and towards a × u; together as far as a has turned away. No three angles have
to be taken one after the other, so that nothing locks; only where a points straight back have tilt and twist no meaning.

Baerlocher and Boulic 2001, "Parametrization and range of motion of the ball-and-socket joint". Differs: four half-axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SwingTwist:
    """What a ball joint may do, seen in its joint frame.

        shoulder = art.SwingTwist(axis=(0, 1, 0), toward=(1, 0, 0), swing=(2.2, 0.7, 0.6, 1.6), twist=(-1.2, 1.2))
        builder.joint("shoulder", "ball", "torso", "arm", limits=art.Limits(ball=shoulder))

    The axis may tip into four directions by as much as `swing` says, and in between as far as quarters of ellipses allow.

    Attributes:
        axis: a, the direction about which it twists, in the joint frame and, at neutral, in the child link's: along a bone.
        toward: where swings are measured from; what of it is not across the axis does not count.
        swing: how far the axis may tip towards u, away from it, towards a × u, and away from that [rad]; π or more is
            all the way. Here u is `toward`, made square to a.
        twist: least and largest turn about the axis [rad], not more than a whole turn apart.
    """

    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    toward: tuple[float, float, float] = (1.0, 0.0, 0.0)
    swing: tuple[float, float, float, float] = (math.pi, math.pi, math.pi, math.pi)
    twist: tuple[float, float] = (-math.pi, math.pi)

    def __post_init__(self):
        for name, size in (("axis", 3), ("toward", 3), ("swing", 4), ("twist", 2)):
            try:
                values = tuple(float(x) for x in getattr(self, name))
            except (TypeError, ValueError):
                values = ()
            if len(values) != size or not all(map(math.isfinite, values)):
                raise ValueError(f"{name} of a ball joint's limits is {getattr(self, name)!r}; expected {size} finite numbers")
            object.__setattr__(self, name, values)
        if np.linalg.norm(self.axis) < 1e-9 or np.linalg.norm(np.cross(self.axis, self.toward)) < 1e-6 * np.linalg.norm(
            self.axis
        ):
            raise ValueError(
                f"axis {self.axis} and toward {self.toward} of a ball joint's limits are parallel or zero;"
                " give the bone's direction, and one across it"
            )
        if min(self.swing) < 0.0:
            raise ValueError(f"swing of a ball joint's limits is {self.swing}; expected four angles, zero or more [rad]")
        lower, upper = self.twist
        if not lower <= upper <= lower + 2.0 * math.pi + 1e-9 or max(-lower, upper) > 2.0 * math.pi:
            raise ValueError(
                f"twist of a ball joint's limits is {self.twist}; expected least and largest angle, a turn apart at most [rad]"
            )

    @property
    def frame(self) -> np.ndarray:
        """u, a × u and a as columns, shape (3, 3)."""
        a = np.array(self.axis) / np.linalg.norm(self.axis)
        u = np.array(self.toward) - a * (a @ self.toward)
        u /= np.linalg.norm(u)
        return np.column_stack([u, np.cross(a, u), a])

    @property
    def swings(self) -> bool:
        """Whether it may not swing all the way."""
        return min(self.swing) < math.pi

    @property
    def twists(self) -> bool:
        """Whether it may not twist all the way."""
        return self.twist[1] - self.twist[0] < 2.0 * math.pi - 1e-9


def turn_of(limits: SwingTwist, tilt: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """The turn with this tilt, shape (..., 2), and twist, shape (...) [rad], as unit quaternions xyzw, shape (..., 4)."""
    u, w, a = limits.frame.T
    angle = np.linalg.norm(tilt, axis=-1, keepdims=True)
    # np.sinc(x) is sin(πx)/(πx); what tips a towards u turns about a × u
    half = 0.5 * np.sinc(angle / (2.0 * np.pi))
    s = half * (tilt[..., :1] * w - tilt[..., 1:] * u)
    s_w = np.cos(0.5 * angle)[..., 0]
    sine, cosine = np.sin(0.5 * twist), np.cos(0.5 * twist)
    vector = s * cosine[..., None] + (s_w * sine)[..., None] * a + np.cross(s, a) * sine[..., None]
    return np.concatenate([vector, (s_w * cosine)[..., None]], axis=-1)  # s is square to a


def random_turn(limits: SwingTwist, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Turns within limits, uniform in the area of the tilt and in twist: unit quaternions xyzw, shape (*shape, 4)."""
    direction, part = rng.uniform(0.0, 2.0 * np.pi, shape), np.sqrt(rng.uniform(0.0, 1.0, shape))
    tilt = np.stack([np.cos(direction), np.sin(direction)], axis=-1) * part[..., None]
    reach = np.minimum(limits.swing, np.pi)
    tilt *= np.where(tilt > 0.0, reach[[0, 2]], reach[[1, 3]])
    return turn_of(limits, tilt, rng.uniform(*limits.twist, shape))
