"""Surfaces to stand on: planes, terrain, stairs."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from articulated.extras import need


def check_number(name: str, value: float, lowest: float, highest: float, expected: str) -> None:
    """That a number lies in a range.

    Raises:
        ValueError: it does not.
    """
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    if not number or not (lowest <= value <= highest) or math.isinf(value):
        raise ValueError(f"{name} is {value!r}; expected {expected}")


def vector(name: str, value: Sequence[float]) -> tuple[float, float, float]:
    """Three finite numbers.

    Raises:
        ValueError: they are not.
    """
    try:
        x, y, z = (float(x) for x in value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r}; expected three numbers") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise ValueError(f"{name} is {value!r}; every entry must be finite")
    return x, y, z


@dataclass(frozen=True)
class Plane:
    """A half-space: solid on the far side of a plane.

    Attributes:
        normal: out of the ground, any length.
        point: on the plane [m].
    """

    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self):
        normal, point = vector("normal", self.normal), vector("point", self.point)
        size = math.hypot(*normal)
        if size == 0.0:
            raise ValueError("normal of a plane is the zero vector; expected a direction, out of the ground")
        object.__setattr__(self, "normal", tuple(x / size + 0.0 for x in normal))
        object.__setattr__(self, "point", point)


@dataclass(frozen=True, eq=False)
class HeightField:
    """Terrain: heights over a rectangle of the x-y plane; beyond its edges they go on as at the edge.

    Between them it is smooth, a quadratic spline, which rounds what is sharper than two or three of them. What touches it sees
    the plane that touches it below its centre: shapes should be smaller than what the terrain does. For stairs see `Stairs`.

    Attributes:
        heights: z at each point of a grid, shape (rows along y, columns along x), at least 2 by 2 [m].
        spacing: between neighbours, along x and y [m].
        origin: where the first of them stands: x, y, and what is added to all heights [m].

    Raises:
        ValueError: a height is not finite, or a shape or a spacing impossible.
    """

    heights: np.ndarray
    spacing: tuple[float, float]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self):
        heights = np.array(self.heights, dtype=float)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ValueError(f"heights has shape {heights.shape}; expected two axes, of two or more points each")
        if not np.isfinite(heights).all():
            where = tuple(int(k) for k in np.argwhere(~np.isfinite(heights))[0])
            raise ValueError(f"heights{list(where)} is {heights[where]}; every entry must be finite")
        given = (self.spacing, self.spacing) if isinstance(self.spacing, (int, float)) else tuple(self.spacing)
        if len(given) != 2 or not all(math.isfinite(x) and x > 0.0 for x in given):
            raise ValueError(f"spacing is {self.spacing!r}; expected two positive numbers, along x and y [m]")
        heights.setflags(write=False)
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "spacing", (float(given[0]), float(given[1])))
        object.__setattr__(self, "origin", vector("origin", self.origin))

    @staticmethod
    def from_image(path: str | os.PathLike[str], size: tuple[float, float], height: float) -> HeightField:
        """Terrain from an image: black is 0, white is `height`; its middle stands at the origin, its top towards +y.

        Args:
            path: of a file that Pillow reads.
            size: of the terrain, along x and y [m].
            height: of what is white [m].

        Raises:
            ImportError: Pillow is not there; the error names the extra that brings it.
            ValueError: the file is no image.
            FileNotFoundError: there is no file.
        """
        image = need("PIL.Image", "image")
        try:
            with image.open(path) as opened:
                values = np.asarray(opened.convert("F") if opened.mode != "F" else opened, dtype=float)
                most = 65535.0 if opened.mode.startswith("I") else 255.0
        except image.UnidentifiedImageError:
            raise ValueError(f"{os.fspath(path)} is not an image that can be read") from None
        rows, columns = values.shape
        spacing = size[0] / max(columns - 1, 1), size[1] / max(rows - 1, 1)
        return HeightField(values[::-1] / most * height, spacing, (-0.5 * size[0], -0.5 * size[1], 0.0))


@dataclass(frozen=True)
class Stairs:
    """A flight of stairs; without end to its sides, and with a landing that goes on.

    Attributes:
        rise, run: of a step [m].
        count: how many.
        start: on the foot of the first riser; all is floor before it [m].
        heading: which way is up: the angle from x about z [rad].

    Raises:
        ValueError: a number is impossible, or not finite.
    """

    rise: float
    run: float
    count: int
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading: float = 0.0

    def __post_init__(self):
        check_number("rise", self.rise, 1e-6, 1e6, "a positive number [m]")
        check_number("run", self.run, 1e-6, 1e6, "a positive number [m]")
        check_number("heading", self.heading, -1e6, 1e6, "an angle [rad]")
        if not isinstance(self.count, int) or self.count < 1:
            raise ValueError(f"count is {self.count!r}; expected a number of steps, 1 or more")
        object.__setattr__(self, "start", vector("start", self.start))


@dataclass(frozen=True)
class Blocks:
    """Every other step of some stairs, with all that is below and behind it: of such blocks, a shape meets one at a time.

    Attributes:
        stairs: which.
        odd: whether those with odd numbers, counted from 0; the floor is number -1.
    """

    stairs: Stairs
    odd: bool


Surface = Plane | HeightField | Stairs
Solid = Plane | HeightField | Blocks
"""What a shape can meet in one point."""


def solids(surfaces: Sequence[Surface]) -> tuple[Solid, ...]:
    """What surfaces are made of."""
    parts: list[Solid] = []
    for surface in surfaces:
        parts += [Blocks(surface, True), Blocks(surface, False)] if isinstance(surface, Stairs) else [surface]
    return tuple(parts)
