"""Loops: what joins two links, or a link and the world, besides the joints of the tree."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from articulated.rig.errors import did_you_mean
from articulated.rig.frames import is_pose, rotation_with_z_along

_PLACE, _ABOUT = ("x", "y", "z"), ("about x", "about y", "about z")
_ACROSS, _TILT = ("across 1", "across 2"), ("about 1", "about 2")

KINDS: dict[str, tuple[str, ...]] = {
    "point": _PLACE,
    "hinge": (*_PLACE, *_TILT),
    "slider": (*_ACROSS, *_TILT, "about axis"),
    "universal": (*_PLACE, "about both"),
    "cylindrical": (*_ACROSS, *_TILT),
    "planar": ("along", *_TILT),
    "weld": (*_PLACE, *_ABOUT),
    "distance": ("along",),
    "gear": ("turn",),
}
"""Every kind of loop, and what each of its rows holds still: a direction of frame A, or a turn about one."""

_WITH_AXIS = ("hinge", "slider", "universal", "cylindrical", "planar")


@dataclass(frozen=True, eq=False)
class Loop:
    """What joins a frame A on one link to a frame B on another; see `KINDS`.

        art.Loop("hinge", "coupler", (0.9, 0, 0), "rocker", (0, 0, 0.7), axis=(0, 1, 0))
        art.Loop("weld", "left_hand", None, "bar", (0, 0.3, 0))
        art.Loop("distance", "hook", None, "crate", (0, 0, 0.5), length=3.0, rope=True)
        art.Loop("gear", "pinion", None, "rack", None, ratio=0.02)

    | kind | rows | what stays free |
    |---|---|---|
    | point | 3 | all turns |
    | hinge | 5 | turning about the axis |
    | slider | 5 | moving along the axis |
    | universal | 4 | turning about `axis`, fixed in A, and about `axis2`, fixed in B |
    | cylindrical | 4 | turning about the axis and moving along it |
    | planar | 3 | moving in the plane normal to the axis, and turning in it |
    | weld | 6 | nothing |
    | distance | 1 | all but the distance of the two origins; a rope's may also be less |
    | gear | 1 | all but q_b − ratio q_a − offset, which stays 0 |

    Attributes:
        kind: one of these.
        link_a, link_b: names of links, or None for the world; of a gear, names of joints with one coordinate.
        pose_a, pose_b: frames A and B in these links, shape (4, 4) or (3,) for a mere point; None is the link's own. [m]
        axis: a direction, in A and likewise in B: where the loop is closed the two coincide, shape (3,).
        axis2: the second axis of a universal joint, in B; it is held at right angles to the first, shape (3,).
        length: of a distance [m].
        rope: whether a distance may also be shorter.
        ratio, offset: of a gear [of the joints' units].
        name: for errors and reports.

    Raises:
        ValueError: the kind is unknown, a number is impossible, or something is missing.
    """

    kind: str
    link_a: str | None
    pose_a: ArrayLike | None
    link_b: str | None
    pose_b: ArrayLike | None
    axis: ArrayLike | None = None
    axis2: ArrayLike | None = None
    length: float | None = None
    rope: bool = False
    ratio: float | None = None
    offset: float = 0.0
    name: str = ""
    frames: tuple[np.ndarray, np.ndarray] = field(init=False, repr=False)
    """A and B as matrices, turned so that the axis is z; of a universal joint each has its own axis as z."""

    def __post_init__(self):
        if self.kind not in KINDS:
            expected = f"expected one of {', '.join(KINDS)}{did_you_mean(self.kind, KINDS)}"
            raise ValueError(f"kind of loop is {self.kind!r}; {expected}")
        if not self.name:
            between = "-".join(str(link or "world") for link in (self.link_a, self.link_b))
            object.__setattr__(self, "name", f"{self.kind} {between}")
        for name, wanted in (("axis", self.kind in _WITH_AXIS), ("axis2", self.kind == "universal")):
            if (getattr(self, name) is not None) != wanted:
                raise ValueError(f"{self} {f'needs {name}=, a direction' if wanted else f'has no use for {name}'}")
        for name, kind in (("length", "distance"), ("ratio", "gear")):
            value, wanted = getattr(self, name), self.kind == kind
            if (value is not None) != wanted:
                raise ValueError(f"{self} {f'needs {name}=' if wanted else f'has no use for {name}'}")
            if wanted and not math.isfinite(value):
                raise ValueError(f"{name} of {self} is {value!r}; expected a finite number")
        if self.kind == "distance" and not self.length > 0.0:  # type: ignore[operator]
            raise ValueError(f"length of {self} is {self.length!r}; expected more than 0; a point loop holds points together")
        if self.rope and self.kind != "distance":
            raise ValueError(f"{self} cannot be a rope; only a distance can")
        if not math.isfinite(self.offset):
            raise ValueError(f"offset of {self} is {self.offset!r}; expected a finite number")
        z_a, z_b = self._direction("axis"), self._direction("axis2" if self.kind == "universal" else "axis")
        A, B = self.poses
        object.__setattr__(self, "frames", (A @ z_a, B @ z_b))

    def __str__(self) -> str:
        return f"loop {self.name!r}"

    @property
    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """A and B as matrices, as they are given."""
        return self._pose("pose_a"), self._pose("pose_b")

    @property
    def rows(self) -> tuple[str, ...]:
        """What each of its rows holds still."""
        return KINDS[self.kind]

    def _pose(self, name: str) -> np.ndarray:
        given = getattr(self, name)
        if given is None:
            return np.eye(4)
        if self.kind == "gear":
            raise ValueError(f"{self} joins joints and has no use for {name}")
        try:
            array = np.array(given, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"{name} of {self} is {given!r}; expected numbers, shape (4, 4) or (3,)") from None
        pose = np.eye(4)
        if array.shape == (3,):
            pose[:3, 3] = array
        elif array.shape == (4, 4):
            pose = array
        else:
            raise ValueError(f"{name} of {self} has shape {array.shape}; expected (4, 4) or (3,)")
        if not np.isfinite(pose).all():
            raise ValueError(f"{name} of {self} holds {array[~np.isfinite(array)][0]}; every entry must be finite")
        if not is_pose(pose):
            raise ValueError(f"{name} of {self} is not a rotation and a translation, last row 0 0 0 1")
        return pose

    def _direction(self, name: str) -> np.ndarray:
        """A turn that takes z to a direction."""
        given, turn = getattr(self, name), np.eye(4)
        if given is None:
            return turn
        try:
            axis = np.array(given, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"{name} of {self} is {given!r}; expected three numbers") from None
        if axis.shape != (3,) or not np.isfinite(axis).all() or not np.any(axis):
            raise ValueError(f"{name} of {self} is {given!r}; expected three numbers, not all zero")
        turn[:3, :3] = rotation_with_z_along(axis)
        return turn
