"""The ground as users describe it: surfaces, and the material between them and a rig's links."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np


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


Surface = Plane


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
    def material(self) -> Material:
        """Of links that `materials` does not name."""
        return Material(self.friction, self.restitution, self.stiffness, self.dissipation)
