"""The ground as users describe it: surfaces, and the material between them and a rig's links."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from articulated.extras import need


def _check(name: str, value: float, lowest: float, highest: float, expected: str) -> None:
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    if not number or not (lowest <= value <= highest) or math.isinf(value):
        raise ValueError(f"{name} is {value!r}; expected {expected}")


def _vector(name: str, value: Sequence[float]) -> tuple[float, float, float]:
    try:
        x, y, z = (float(x) for x in value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r}; expected three numbers") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise ValueError(f"{name} is {value!r}; every entry must be finite")
    return x, y, z


@dataclass(frozen=True)
class Material:
    """What happens where a pair of shapes touches.

    Attributes:
        friction: Coulomb's coefficient.
        restitution: speed of rebound over speed of impact, 0 to 1.
        stiffness: force over depth at each point of contact [N/m]; None lets the whole rig's weight on one point sink in by
            half a millimetre. In a step, no spring acts harder than that step can follow.
        dissipation: Hunt and Crossley's d in the force k x (1 + d ẋ) [s/m]. What sinks in is pushed out at 1/d at most.
    """

    friction: float = 0.9
    restitution: float = 0.0
    stiffness: float | None = None
    dissipation: float = 10.0

    def __post_init__(self):
        _check("friction", self.friction, 0.0, math.inf, "a number, zero or more")
        _check("restitution", self.restitution, 0.0, 1.0, "a number from 0 to 1")
        _check("dissipation", self.dissipation, 0.0, math.inf, "a number of s/m, zero or more")
        if self.stiffness is not None:
            _check("stiffness", self.stiffness, 1e-12, math.inf, "a positive number of N/m, or None")


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
        normal, point = _vector("normal", self.normal), _vector("point", self.point)
        size = math.hypot(*normal)
        if size == 0.0:
            raise ValueError("normal of a plane is the zero vector; expected a direction, out of the ground")
        object.__setattr__(self, "normal", tuple(x / size + 0.0 for x in normal))
        object.__setattr__(self, "point", point)


@dataclass(frozen=True, eq=False)
class HeightField:
    """Terrain: heights over a rectangle of the x-y plane, bilinear between them; beyond its edges they go on as at the edge.

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
        object.__setattr__(self, "origin", _vector("origin", self.origin))

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

    @staticmethod
    def steps(rise: float, run: float, count: int, width: float = 4.0, edge: float = 0.01) -> HeightField:
        """Stairs along x, the first rising at 0; each riser leans by `edge`.

        Args:
            rise, run: of a step [m].
            count: how many.
            width: along y, about 0 [m].
            edge: how far a riser leans back [m], less than `run`.
        """
        n = max(2, round(run / edge))
        x = np.arange(-n, n * (count + 1) + 1)
        profile = rise * np.clip(x // n + (x % n > 0), 0, count)
        return HeightField(np.vstack([profile, profile]), (run / n, width), (-run, -0.5 * width, 0.0))


Surface = Plane | HeightField


@dataclass(frozen=True, eq=False)
class Ground:
    """What a rig stands on, and how it is to touch.

        art.Ground(friction=0.6)                                     # the plane z = 0
        art.Ground([art.Plane(normal=(0, -0.2, 1)), art.Plane((1, 0, 0), (-3, 0, 0))])

    Attributes:
        surfaces: what is solid: a surface or several.
        friction, restitution, stiffness, dissipation: see `Material`: of all links that `materials` does not name.
        materials: of links, by name: of the pair of that link and the ground.
        velocity: of the ground's surface, in the world [m/s]: a conveyor moves what stands on it.

    Raises:
        ValueError: a number is impossible, or not finite.
    """

    surfaces: Surface | Sequence[Surface] = (Plane(),)
    friction: float = 0.9
    restitution: float = 0.0
    stiffness: float | None = None
    dissipation: float = 10.0
    materials: Mapping[str, Material] = field(default_factory=dict)
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self):
        surfaces = (self.surfaces,) if isinstance(self.surfaces, Surface) else tuple(self.surfaces)
        for surface in surfaces:
            if not isinstance(surface, Surface):
                raise ValueError(f"surfaces holds {surface!r}; expected planes and height fields")
        if not surfaces:
            raise ValueError("surfaces is empty; expected at least one surface, or no ground at all")
        object.__setattr__(self, "surfaces", surfaces)
        object.__setattr__(self, "materials", MappingProxyType(dict(self.materials)))
        object.__setattr__(self, "velocity", _vector("velocity", self.velocity))
        for name, material in self.materials.items():
            if not isinstance(material, Material):
                raise ValueError(f"the material of link {name!r} is {material!r}; expected a Material")
        _ = self.material  # is checked

    @property
    def solids(self) -> tuple[Surface, ...]:
        """The surfaces."""
        return self.surfaces if isinstance(self.surfaces, tuple) else ()

    @property
    def material(self) -> Material:
        """Of links that `materials` does not name."""
        return Material(self.friction, self.restitution, self.stiffness, self.dissipation)
