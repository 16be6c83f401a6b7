"""What a controller asks of drives: more than a target, if need be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from articulated.rig import Rig
from articulated.simulation.actuation import Gains
from articulated.simulation.state import State


@dataclass(frozen=True, eq=False)
class Command:
    """A target, and gains that hold for one control period: what a control function may return where there are drives.

        return art.Command(pose, stiffness=weights * stiffness)

    Only what the simulation's `PD` drives can be commanded; a coordinate whose gains are zero goes limp.

    Attributes:
        target: the configuration to hold, shape (..., nq).
        stiffness, damping: gains instead of the PD's, shape (..., nv) [N m/rad, N m s/rad; N/m, N s/m]; None for those.
        limit: likewise the largest torque or force; only if the `PD` limits any.
        tau: generalized forces besides, shape (..., nv) [N m, N]; those of drives are within their limits.
    """

    target: ArrayLike
    stiffness: ArrayLike | None = None
    damping: ArrayLike | None = None
    limit: ArrayLike | None = None
    tau: ArrayLike | None = None


Answer = Callable[[float, State], Any]


def split(control: Any, gains: Gains, rig: Rig) -> tuple[Any, Any, Any]:
    """A control of drives as what it says of targets, of forces besides, and of gains; each constant, a function, or None.

    Functions ask the control once for each moment.
    """
    if isinstance(control, Command):
        return control.target, control.tau, _gains_of(control, gains, rig)
    if not callable(control):
        return control, None, None
    asked: list[tuple[float, State, Any]] = []

    def ask(t: float, state: State) -> Any:
        if not asked or asked[0][0] != t or asked[0][1] is not state:
            asked[:] = [(t, state, control(t, state))]
        return asked[0][2]

    def target(t: float, state: State) -> Any:
        answer = ask(t, state)
        return answer.target if isinstance(answer, Command) else answer

    def tau(t: float, state: State) -> Any:
        answer = ask(t, state)
        return answer.tau if isinstance(answer, Command) else None

    def numbers(t: float, state: State) -> Any:
        answer = ask(t, state)
        return _gains_of(answer, gains, rig) if isinstance(answer, Command) else None

    return target, tau, numbers


def _gains_of(command: Command, gains: Gains, rig: Rig) -> np.ndarray | None:
    """Stiffness, damping and limits of all drives, in the order of a scene's numbers; None for those that it has anyway."""
    parts, changed, driven = [], False, list(gains.drives.coordinates)
    for name in ("stiffness", "damping", "limit"):
        given, own = getattr(command, name), getattr(gains, name)
        if name == "limit" and not gains.drives.limited:
            if given is not None:
                raise ValueError("a command limits drives that have no limits; give the PD a limit, however high")
            continue
        if given is not None:
            array = np.asarray(given, dtype=float)
            if array.ndim == 0 or array.shape[-1] != rig.nv:
                raise ValueError(f"{name} of a command has shape {array.shape}; expected (..., {rig.nv}) for rig {rig.name!r}")
            own, changed = array[..., driven], True
            if np.isnan(own).any() or (own < 0.0).any() or (name != "limit" and np.isinf(own).any()):
                raise ValueError(
                    f"{name} of a command holds {own[~(own >= 0.0) | np.isinf(own)][0]}; expected numbers, zero or more"
                )
            own = np.minimum(own, _LARGEST)
        parts.append(own)
    if not changed:
        return None
    batch = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
    return np.concatenate([np.broadcast_to(part, (*batch, part.shape[-1])) for part in parts], axis=-1)


_LARGEST = 1e15
"""No gain is larger."""
