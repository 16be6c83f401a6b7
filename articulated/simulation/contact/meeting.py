"""Where pieces of bodies meet each other, and what stands in the world: gaps, normals and points of contact, over scalars.

Pairs are known at compile time. Of each, balls that hold the two pieces are looked at first; where these are too far apart in
all states of a group, machine code skips the rest. Pairs of the same kinds of shapes share their code.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, each, given
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
_SIZE = 7
"""Numbers of a touch."""


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
    now: Tree, pieces: Sequence[Piece], pairs: Sequence[Pair], body: Callable[..., list[Scalar]], *values: Sequence[Any]
) -> list[list[Scalar]]:
    """What `body` makes of each pair: of its two shapes as they stand, and of what belongs to it of each of some lists.

    Pairs of shapes of the same kinds are rows of one loop.
    """
    placed = {k: place(now, pieces[k]) for pair in pairs for k in (pair.a, pair.b)}
    groups: dict[Any, list[int]] = {}
    for n, pair in enumerate(pairs):
        groups.setdefault((_likeness(placed[pair.a]), _likeness(placed[pair.b])), []).append(n)
    results: dict[int, list[Scalar]] = {}
    for some in groups.values():
        likes = [placed[k] for k in (pairs[some[0]].a, pairs[some[0]].b)]
        rows = [[*([*_numbers(placed[k])] for k in (pairs[n].a, pairs[n].b)), *(x[n] for x in values)] for n in some]

        def of_row(row: list[Any], likes: list[Placed] = likes) -> list[Scalar]:
            a, b = (_placed(like, numbers) for like, numbers in zip(likes, row, strict=False))
            return body(a, b, *row[2:])

        results.update(zip(some, each(rows, of_row), strict=True))
    return [results[n] for n in range(len(pairs))]


def touches(now: Tree, pieces: Sequence[Piece], pairs: Sequence[Pair], near: bool = False) -> list[Touch]:
    """Of all pairs, one after the other; of those whose balls are apart, if only those `near` are wanted, they are `FAR`."""
    reaches = [pieces[pair.a].reach + pieces[pair.b].reach for pair in pairs]

    def numbers(a: Placed, b: Placed) -> list[Scalar]:
        return [x for touch in meet(a, b) for x in (touch.size, *touch.normal, *touch.point)]

    def of_pair(a: Placed, b: Placed, reach: Scalar) -> list[Scalar]:
        if not near:
            return numbers(a, b)
        nothing = [FAR, *[0.0] * (_SIZE - 1)] * len(meet(a, b))
        return given(within(a, b, reach), lambda: numbers(a, b), nothing)

    found = []
    for some in each_pair(now, pieces, pairs, of_pair, reaches):
        for k in range(0, len(some), _SIZE):
            size, *rest = some[k : k + _SIZE]
            found.append(Touch(size, Vec3.of(rest[:3]), Vec3.of(rest[3:])))
    return found


def within(a: Placed, b: Placed, reach: Scalar) -> Scalar:
    """Whether the middles of two shapes are nearer than this."""
    apart = a.center - b.center
    return apart.dot(apart) < reach * reach


def _likeness(shape: Placed) -> Any:
    """What shapes of one kind have in common."""
    return (type(shape), shape.solid if isinstance(shape, Hull) else isinstance(shape, Rod) and shape.half is None)


def _numbers(shape: Placed) -> list[Scalar]:
    if isinstance(shape, Rod):
        return [*shape.center, shape.radius, *(shape.half or ())]
    if isinstance(shape, Roller):
        return [*shape.center, shape.radius, shape.half, *shape.axis]
    turned = [*shape.center, *(x for row in shape.R.rows for x in row)]
    return [*turned, *shape.half] if isinstance(shape, Block) else turned


def _placed(like: Placed, numbers: Sequence[Scalar]) -> Placed:
    center, rest = Vec3.of(numbers[:3]), numbers[3:]
    if isinstance(like, Rod):
        return Rod(center, Vec3.of(rest[1:]) if like.half else None, rest[0])
    if isinstance(like, Roller):
        return Roller(center, Vec3.of(rest[2:]), rest[0], rest[1])
    R = Mat3.of([rest[k : k + 3] for k in (0, 3, 6)])
    return Block(center, R, (rest[9], rest[10], rest[11])) if isinstance(like, Block) else Hull(center, R, like.solid)


def _somewhere(piece: Piece, x: float) -> Placed:
    """The piece as plain numbers."""
    return placed(piece, Mat3.identity(), Vec3(x, 0.3, 0.2))
