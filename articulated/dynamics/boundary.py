"""The boundary of the project: arrays from users are checked here, before any algorithm runs.

What is wrong is said with its name, its shape, what was expected, the rig, and for a value the state and coordinate.
"""

from __future__ import annotations

import operator
from typing import Any, NamedTuple

import numpy as np

from articulated.rig import Link, Rig
from articulated.rig.errors import did_you_mean

GRAVITY = (0.0, 0.0, -9.81)
"""Standard gravity [m/s²], z up."""

NORM_TOLERANCE = {np.dtype(np.float64): 1e-6, np.dtype(np.float32): 1e-4}
"""How far from 1 the norm of a quaternion may be."""


class Argument(NamedTuple):
    """An array argument: its name for errors, its value, and the shape that belongs to one state.

    Attributes:
        role: "q" makes its quaternions be checked too; a "gravity" that is the usual one is compiled in, and does not keep a
            float32 call from being one; "optional" is what may be left out.
    """

    name: str
    value: Any
    shape: tuple[int, ...]
    role: str = ""

    @property
    def fixed(self) -> bool:
        """Whether its value is part of the program: none, the usual gravity, or a constant."""
        return self.value is None or self.value is GRAVITY or self.role == "constant"


def checked(rig: Rig, argument: Argument) -> np.ndarray:
    """The argument as an array of float32 or float64, shape (..., *argument.shape)."""
    name, shape = argument.name, argument.shape
    try:
        array = np.asarray(argument.value)
    except ValueError as error:
        raise ValueError(f"{name} is not an array: {error}; expected {_expected(shape)} for rig {rig.name!r}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} holds {array.dtype}; expected real numbers, shape {_expected(shape)}")
    if array.dtype != np.float32:
        array = array.astype(np.float64, copy=False)
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim < len(shape):
        raise ValueError(f"{name} has shape {array.shape}; expected {_expected(shape)} for rig {rig.name!r}")
    if not np.isfinite(array).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(
            f"{name}{list(where)} is {array[where]} ({_coordinate(rig, argument, where)}); every entry must be finite"
        )
    if argument.role == "q":
        _check_quaternions(rig, name, array)
    return array


def check_threads(threads: int | None) -> None:
    """Refuse a number of threads that is not a positive integer (None: as many as are useful)."""
    if threads is None:
        return
    try:
        count = operator.index(threads)
    except TypeError:
        raise ValueError(f"threads is {threads!r}; expected a positive integer or None") from None
    if count < 1:
        raise ValueError(f"threads is {threads!r}; expected a positive integer or None")


def find_link(rig: Rig, link: str | int | Link) -> Link:
    """The link with this name or index."""
    links = list(rig.links.values())
    if isinstance(link, Link):
        if rig.links.get(link.name) is link:
            return link
        raise ValueError(f"link {link.name!r} is of another rig, not of {rig.name!r}")
    if isinstance(link, str):
        if link in rig.links:
            return rig.links[link]
        raise ValueError(f"rig {rig.name!r} has no link {link!r}{did_you_mean(link, rig.links)}")
    index = operator.index(link)
    if not -len(links) <= index < len(links):
        raise ValueError(f"link index is {index}; expected less than {len(links)} for rig {rig.name!r}")
    return links[index]


def _check_quaternions(rig: Rig, name: str, q: np.ndarray) -> None:
    for joint, where in rig.quaternions.items():
        quat = q[..., where]
        norm = np.sqrt((quat * quat).sum(axis=-1))
        wrong = np.abs(norm - 1.0) > NORM_TOLERANCE[q.dtype]
        if np.any(wrong):
            state = tuple(int(k) for k in np.argwhere(wrong)[0])
            raise ValueError(
                f"{name}: the quaternion of joint {joint!r} has norm {norm[state]:.6g}"
                f"{f' in state {list(state)}' if state else ''}; expected 1, scalar last (xyzw); divide it by its norm"
            )


def _coordinate(rig: Rig, argument: Argument, where: tuple[int, ...]) -> str:
    k = where[-1] if where else 0
    if argument.role == "q":
        return rig.q_names[k]
    if argument.shape == (rig.nv,):
        return rig.v_names[k]
    return f"rig {rig.name!r}"


def _expected(shape: tuple[int, ...]) -> str:
    return f"(..., {', '.join(map(str, shape))})" if shape else "(...)"
