"""Drives of joints, and stops at their limits, as users describe them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from articulated.rig import Rig
from articulated.simulation.scene import Drives


@dataclass(frozen=True, eq=False)
class PD:
    """Proportional-derivative drives of joints: p (q_target − q) − d v at the end of each step: no gain is too large.

        art.PD(stiffness=300.0, damping=10.0, limit=80.0)
        art.PD(stiffness={"left_knee": 200.0, "right_knee": 200.0}, damping=5.0, limit="effort")

    Each is a number for all joints but a free or planar root's; or numbers by joint, the others having none; or an array.
    A ball joint is driven along the shortest turn to its target. `tuned` chooses them by frequency and damping ratio.

    Attributes:
        stiffness: p, shape (..., nv) if an array [N m/rad, N/m].
        damping: d, likewise [N m s/rad, N s/m].
        limit: largest torque or force, likewise [N m, N]; or "effort": the limits that the rig gives.
        help: what helps a free or planar root to its target, which no motor of the rig could; None for nothing.
    """

    stiffness: float | Mapping[str, float] | ArrayLike
    damping: float | Mapping[str, float] | ArrayLike = 0.0
    limit: float | Mapping[str, float] | ArrayLike | str = math.inf
    help: RootHelp | None = None


@dataclass(frozen=True)
class RootHelp:
    """A helping hand: a spring and damper between a root and its target, as part of the solve; see `PD`.

    Each is a pair, for its position and for its orientation, in the root's own axes.

    Attributes:
        stiffness: [N/m], [N m/rad].
        damping: [N s/m], [N m s/rad].
        limit: largest force and couple, along each axis [N], [N m].
    """

    stiffness: tuple[float, float]
    damping: tuple[float, float] = (0.0, 0.0)
    limit: tuple[float, float] = (math.inf, math.inf)

    def __post_init__(self):
        for name in ("stiffness", "damping", "limit"):
            given = getattr(self, name)
            pair = given if isinstance(given, Sequence) and len(given) == 2 else (None,)
            if not all(isinstance(x, (int, float, np.number)) and x >= 0.0 and (name == "limit" or x < math.inf) for x in pair):
                raise ValueError(f"{name} of a root's help is {given!r}; expected two numbers, zero or more: linear, angular")


@dataclass(frozen=True)
class Stops:
    """What happens at joint limits: a spring and damper, as in contact, on the inertia that is felt there.

    Attributes:
        period: of that spring [s]; a step's length is the shortest that it can be. A force f holds the joint f/m (period/2π)²
            beyond its limit, if m is the inertia.
        dissipation: Hunt and Crossley's [s/rad, s/m]; what is beyond is pushed back at 1/d at most.
        restitution: speed of rebound over speed of impact, 0 to 1.
    """

    period: float = 0.005
    dissipation: float = 5.0
    restitution: float = 0.0

    def __post_init__(self):
        for name, lowest, highest in (("period", 1e-9, 1e9), ("dissipation", 0.0, 1e9), ("restitution", 0.0, 1.0)):
            value = getattr(self, name)
            if not isinstance(value, (int, float, np.number)) or not lowest <= value <= highest:
                raise ValueError(f"{name} of stops is {value!r}; expected a number from {lowest:g} to {highest:g}")

    @property
    def stiffness(self) -> float:
        """Over the inertia [1/s²]."""
        return (2.0 * math.pi / self.period) ** 2


@dataclass(frozen=True, eq=False)
class Gains:
    """A `PD` for one rig.

    Attributes:
        drives: which coordinates it drives.
        stiffness, damping, limit: of these, shape (..., n).
    """

    drives: Drives
    stiffness: np.ndarray
    damping: np.ndarray
    limit: np.ndarray = field(default_factory=lambda: np.zeros(0))


def gains(rig: Rig, pd: PD) -> Gains:
    """The gains of a rig's coordinates.

    Raises:
        ValueError: a joint is unknown or cannot be driven, or a number is negative or not finite.
    """
    roots = {k for j in rig.joints.values() if j.kind in ("floating", "planar") for k in range(j.v_slice.start, j.v_slice.stop)}
    free = np.array([k not in roots for k in range(rig.nv)], dtype=bool)
    limit = _efforts(rig) if isinstance(pd.limit, str) and pd.limit == "effort" else pd.limit
    values = {}
    for name, given, default in (("stiffness", pd.stiffness, 0.0), ("damping", pd.damping, 0.0), ("limit", limit, math.inf)):
        values[name] = _per_coordinate(rig, name, given, default, free)
    for name in ("stiffness", "damping"):
        if np.any(values[name][..., ~free]):
            raise ValueError(
                f"{name} drives a floating or planar joint, which no motor does; push it with external wrenches, or help"
            )
    if pd.help is not None:
        free = free | _helped(rig, pd.help, values)
    driven = free & (_some(values["stiffness"]) | _some(values["damping"]))
    coordinates = tuple(np.flatnonzero(driven).tolist())
    limited = bool(np.isfinite(values["limit"][..., driven]).any())
    p, d, most = (values[name][..., driven] for name in ("stiffness", "damping", "limit"))
    return Gains(Drives(coordinates, limited), p, d, np.minimum(most, _NO_LIMIT) if limited else most[..., :0])


def _helped(rig: Rig, help: RootHelp, values: dict[str, np.ndarray]) -> np.ndarray:
    """Which coordinates are a root's, whose gains are written down."""
    helped = np.zeros(rig.nv, dtype=bool)
    roots = [joint for joint in rig.joints.values() if rig.is_root(joint)]
    if not roots:
        raise ValueError(f"rig {rig.name!r} has no free or planar root to be helped; leave help out, or load it with one")
    for joint in roots:
        helped[joint.v_slice] = True
        linear = 3 if joint.kind == "floating" else 2
        for name, array in values.items():
            pair = getattr(help, name)
            values[name] = array = array.copy()
            array[..., joint.v_slice] = [*[pair[0]] * linear, *[pair[1]] * (joint.nv - linear)]
    return helped


_NO_LIMIT = 1e9
"""What a torque without limit is held to where others have one [N m]."""


def _some(values: np.ndarray) -> np.ndarray:
    return np.asarray((values > 0.0).any(axis=tuple(range(values.ndim - 1))))


def _efforts(rig: Rig) -> dict[str, float]:
    return {name: joint.limits.effort or math.inf for name, joint in rig.joints.items() if not joint.mimic}


def _per_coordinate(rig: Rig, name: str, given, default: float, free: np.ndarray) -> np.ndarray:
    if isinstance(given, Mapping):
        values = np.full(rig.nv, default)
        for joint, value in given.items():
            if joint not in rig.joints:
                raise ValueError(f"{name}: rig {rig.name!r} has no moving joint {joint!r}")
            values[rig.joints[joint].v_slice] = value
    else:
        try:
            values = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"{name} is {given!r}; expected a number, numbers by joint, or an array") from None
        if values.ndim == 0:
            values = np.where(free, values, default)
        elif values.shape[-1] != rig.nv:
            raise ValueError(f"{name} has shape {values.shape}; expected (..., {rig.nv}) for rig {rig.name!r}")
    if np.isnan(values).any() or (values < 0.0).any() or (name != "limit" and np.isinf(values).any()):
        raise ValueError(
            f"{name} holds {values[~(values >= 0.0) | np.isinf(values)][0]}; expected finite numbers, zero or more"
        )
    return values
