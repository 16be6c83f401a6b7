"""The ground as users describe it: surfaces, and the material between them and a rig's links."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from articulated.simulation.contact.surfaces import Plane, Solid, Surface, check_number, solids, vector


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
        check_number("friction", self.friction, 0.0, math.inf, "a number, zero or more")
        check_number("restitution", self.restitution, 0.0, 1.0, "a number from 0 to 1")
        check_number("dissipation", self.dissipation, 0.0, math.inf, "a number of s/m, zero or more")
        if self.stiffness is not None:
            check_number("stiffness", self.stiffness, 1e-12, math.inf, "a positive number of N/m, or None")


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
                raise ValueError(f"surfaces holds {surface!r}; expected planes, height fields and stairs")
        if not surfaces:
            raise ValueError("surfaces is empty; expected at least one surface, or no ground at all")
        object.__setattr__(self, "surfaces", surfaces)
        object.__setattr__(self, "materials", MappingProxyType(dict(self.materials)))
        object.__setattr__(self, "velocity", vector("velocity", self.velocity))
        for name, material in self.materials.items():
            if not isinstance(material, Material):
                raise ValueError(f"the material of link {name!r} is {material!r}; expected a Material")
        _ = self.material  # is checked

    @property
    def solids(self) -> tuple[Solid, ...]:
        """What the surfaces are made of."""
        return solids(self.surfaces) if isinstance(self.surfaces, tuple) else ()

    @property
    def material(self) -> Material:
        """Of links that `materials` does not name."""
        return Material(self.friction, self.restitution, self.stiffness, self.dissipation)
