"""What touches what besides the ground, as users describe it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from articulated.rig import Shape
from articulated.rig.shapes import Geometry
from articulated.simulation.contact.ground import Material

Names = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Collisions:
    """Which bodies touch each other and the things that stand around, and how.

        art.Simulation(rig, ground=True, collisions=True)                     # all that can meet
        art.Collisions(exclude=[("left_*", "left_*")], friction=0.5)
        art.Collisions(groups={"balls": ["ball*/*"]}, exclude=[("balls", "balls")], scenery=[art.Shape(art.Box((1, 1, 0.1)))])

    Links are given by name, by a pattern such as "left/*", or by the name of a group. Of all pairs of collision shapes those
    are left out that are on one body or on two that a joint or a loop joins, those that the rig's source disables, those that
    overlap when the rig is neutral, and those that touch in no configuration within the joints' limits that a search finds.
    `collision_pairs` tells what is left, and why what is not.

    Attributes:
        pairs: of links, only these; None chooses as above.
        include: pairs to take in whatever is said above, but for what is on one body.
        exclude: pairs to leave out.
        groups: names and patterns of links, by name of the group.
        scenery: shapes that stand in the world, besides those of links that are fixed to it; "scenery" in pairs.
        friction, restitution, stiffness, dissipation: see `Material`: of all pairs that `materials` does not name.
        materials: of pairs; of several that match, the last counts.

    Raises:
        ValueError: a number is impossible, or something is not of the kind expected.
    """

    pairs: Sequence[Names] | None = None
    include: Sequence[Names] = ()
    exclude: Sequence[Names] = ()
    groups: Mapping[str, Sequence[str]] = field(default_factory=dict)
    scenery: Sequence[Shape | Geometry] = ()
    friction: float = 0.9
    restitution: float = 0.0
    stiffness: float | None = None
    dissipation: float = 10.0
    materials: Mapping[Names, Material] = field(default_factory=dict)

    def __post_init__(self):
        for name in ("pairs", "include", "exclude"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, tuple(_names(name, pair) for pair in value))
        groups = {name: (links,) if isinstance(links, str) else tuple(links) for name, links in self.groups.items()}
        object.__setattr__(self, "groups", MappingProxyType(groups))
        shapes = (self.scenery,) if isinstance(self.scenery, Shape | Geometry) else tuple(self.scenery)
        for shape in shapes:
            if not isinstance(shape, Shape | Geometry):
                raise ValueError(f"scenery holds {shape!r}; expected shapes, such as art.Shape(art.Box((1, 1, 0.2)), pose)")
        object.__setattr__(self, "scenery", tuple(s if isinstance(s, Shape) else Shape(s) for s in shapes))
        materials = {_names("materials", pair): material for pair, material in self.materials.items()}
        for pair, material in materials.items():
            if not isinstance(material, Material):
                raise ValueError(f"the material of {pair!r} is {material!r}; expected a Material")
        object.__setattr__(self, "materials", MappingProxyType(materials))
        _ = self.material  # is checked

    @property
    def material(self) -> Material:
        """Of pairs that `materials` does not name."""
        return Material(self.friction, self.restitution, self.stiffness, self.dissipation)

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The scenery."""
        return tuple(s if isinstance(s, Shape) else Shape(s) for s in self.scenery)


def _names(where: str, pair: object) -> Names:
    if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2 or not all(isinstance(x, str) for x in pair):
        raise ValueError(f"{where} holds {pair!r}; expected pairs of names of links, of patterns or of groups")
    a, b = pair
    return a, b
