"""Where pieces of bodies meet each other, and what stands in the world: gaps, normals and points of contact, over scalars.

Pairs are known at compile time. Of each, balls that hold the two pieces are looked at first; where these are too far apart in
all states of a group, machine code skips the rest. Pairs of the same kinds of shapes share their code.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from articulated.dynamics.tree import Tree
from articulated.scalar import Nested, Scalar, each, given
from articulated.simulation.contact.narrow.axles import roller_roller
from articulated.simulation.contact.narrow.boxes import block_block, rod_block
from articulated.simulation.contact.narrow.hulls import hull_block, hull_hull, hull_rod, hull_roller
from articulated.simulation.contact.narrow.placed import FAR, Block, Hull, Placed, Rod, Roller, Touch
from articulated.simulation.contact.narrow.rods import rod_rod
from articulated.simulation.contact.narrow.rollers import rod_roller, roller_block
from articulated.simulation.contact.pieces import Piece, place, placed
from articulated.spatial import Mat3, Vec3

_MEETINGS: dict[tuple[type, type], Callable[[Any, Any], list[Touch]]] = {
    (Rod, Rod): rod_rod,
    (Rod, Block): rod_block,
    (Rod, Roller): rod_roller,
    (Block, Block): block_block,
    (Roller, Block): roller_block,
    (Roller, Roller): roller_roller,
    (Hull, Rod): hull_rod,
    (Hull, Block): hull_block,
    (Hull, Roller): hull_roller,
    (Hull, Hull): hull_hull,
}


@dataclass(frozen=True)
class Pair:
    """Two pieces that may touch: by their numbers, and which of the materials is between them."""

    a: int
    b: int
    material: int


def meet(a: Placed, b: Placed) -> list[Touch]:
    """Where two shapes touch; normals go from b to a."""
    if meeting := _MEETINGS.get((type(a), type(b))):
        return meeting(a, b)
    return [Touch(touch.size, -touch.normal, touch.point) for touch in _MEETINGS[type(b), type(a)](b, a)]


@lru_cache(maxsize=4096)
def count(a: Piece, b: Piece) -> int:
    """In how many points two pieces may touch at once."""
    return len(meet(_somewhere(a, 0.0), _somewhere(b, 1.0)))


def each_pair(
    now: Tree, pieces: Sequence[Piece], pairs: Sequence[Pair], body: Callable[..., Nested], *values: Sequence[Any]
) -> list[Nested]:
    """As `each_meeting`, of pairs of pieces."""
    placed = {k: place(now, pieces[k]) for pair in pairs for k in (pair.a, pair.b)}
    return each_meeting([(placed[pair.a], placed[pair.b]) for pair in pairs], body, *values)


def each_meeting(pairs: Sequence[tuple[Placed, Placed]], body: Callable[..., Nested], *values: Sequence[Any]) -> list[Nested]:
    """What `body` makes of each pair of shapes, and of what belongs to it of each of some lists.

    Pairs of shapes of the same kinds are rows of one loop.
    """
    groups: dict[Any, list[int]] = {}
    for n, pair in enumerate(pairs):
        groups.setdefault(tuple(map(_kind, pair)), []).append(n)
    results: dict[int, Nested] = {}
    for some in groups.values():
        sides = zip(*(_alike(side) for side in zip(*(pairs[n] for n in some), strict=True)), strict=True)
        rows = [[*pair, *(x[n] for x in values)] for n, pair in zip(some, sides, strict=True)]
        results.update(zip(some, each(rows, lambda row: body(*row)), strict=True))
    return [results[n] for n in range(len(pairs))]


def touches(now: Tree, pieces: Sequence[Piece], pairs: Sequence[Pair], near: bool = False) -> list[Touch]:
    """Of all pairs, one after the other; of those whose balls are apart, if only those `near` are wanted, they are `FAR`."""
    reaches = [pieces[pair.a].reach + pieces[pair.b].reach for pair in pairs]

    def of_pair(a: Placed, b: Placed, reach: Scalar) -> list[Touch]:
        if not near:
            return meet(a, b)
        nothing = [Touch(FAR, Vec3.zero(), Vec3.zero())] * len(meet(a, b))
        return given(within(a, b, reach), lambda: meet(a, b), nothing)

    return [touch for some in each_pair(now, pieces, pairs, of_pair, reaches) for touch in some]


def within(a: Placed, b: Placed, reach: Scalar) -> Scalar:
    """Whether the middles of two shapes are nearer than this."""
    apart = a.center - b.center
    return apart.dot(apart) < reach * reach


def _kind(shape: Placed) -> Any:
    """Shapes of one kind have code in common."""
    return type(shape), isinstance(shape, Rod) and shape.half is None


def _alike(shapes: Sequence[Placed]) -> list[Placed]:
    """Shapes of one kind, of as many numbers."""
    counts = [shape.solid.counts for shape in shapes if isinstance(shape, Hull)]
    most = tuple(map(max, zip(*counts, strict=True)))
    return [replace(shape, solid=shape.solid.filled(most)) if isinstance(shape, Hull) else shape for shape in shapes]


def _somewhere(piece: Piece, x: float) -> Placed:
    """The piece as plain numbers."""
    return placed(piece, Mat3.identity(), Vec3(x, 0.3, 0.2))
