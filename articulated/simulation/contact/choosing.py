"""Which pieces of a rig are worth looking at in every step: those pairs that can touch, and may."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from articulated.dynamics.mechanism import WORLD, Mechanism, mechanism
from articulated.dynamics.tree import Tree, tree
from articulated.rig import Rig
from articulated.rig.errors import did_you_mean
from articulated.rig.fit import is_world
from articulated.scalar import Scalar, least
from articulated.simulation.contact.collisions import Collisions, Names
from articulated.simulation.contact.meeting import each_meeting, meet
from articulated.simulation.contact.pieces import SCENERY, Piece, piece_of, pieces_of, place
from articulated.spatial import Mat3, Pose, Vec3

SCENERY_NAME = "scenery"
_SAMPLES = 4000
"""Configurations that are looked at to tell what never touches."""
_CANDIDATES, _ROUNDS = 32, 40
"""So many of them are brought nearer, so often."""
_CLOSE = 0.05
"""What comes nearer than this part of the smaller piece's size may touch."""
_TOUCHING = 1e-3
"""What overlaps by less than this part of it only touches."""
_SEED = 20


@dataclass(frozen=True, eq=False)
class CollisionPairs:
    """What is looked at in every step, and what is not.

    Attributes:
        pairs: of links that may touch, by name.
        left_out: why others do not.
    """

    pairs: tuple[Names, ...]
    left_out: Mapping[Names, str]


@dataclass(frozen=True, eq=False)
class Choice:
    """As `CollisionPairs`, of pieces: all of them, and pairs of their numbers; and what the names in the question mean."""

    names: Selection
    pieces: tuple[Piece, ...]
    pairs: tuple[tuple[int, int], ...]
    left_out: Mapping[tuple[int, int], str]


def collision_pairs(rig: Rig, collisions: Collisions | bool = True) -> CollisionPairs:
    """The pairs of links that a `Simulation` of a rig lets touch, and why not others.

    Raises:
        ValueError: a name is that of no link and of no group, and a pattern matches nothing.
    """
    choice = chosen(rig, Collisions() if isinstance(collisions, bool) else collisions)

    def names(pair: tuple[int, int]) -> Names:
        a, b = (name_of(rig, choice.pieces[k]) for k in pair)
        return a, b

    pairs = tuple(dict.fromkeys(names(pair) for pair in choice.pairs))
    left_out = {names(pair): reason for pair, reason in choice.left_out.items() if names(pair) not in pairs}
    return CollisionPairs(pairs, MappingProxyType(left_out))


def name_of(rig: Rig, piece: Piece) -> str:
    """The name of a piece's link."""
    return SCENERY_NAME if piece.link == SCENERY else list(rig.links)[piece.link]


def chosen(rig: Rig, collisions: Collisions) -> Choice:
    """The pairs of pieces that may touch."""
    pieces = (*pieces_of(rig), *(piece for shape in collisions.shapes for piece in piece_of(None, shape)))
    names = Selection(rig, collisions)
    m = mechanism(rig)
    bodies, links = [piece.body(m) for piece in pieces], [name_of(rig, piece) for piece in pieces]
    _check_given(names, collisions, list(zip(links, bodies, strict=True)))
    disabled = {frozenset(pair) for pair in rig.disabled_collisions}
    joined = _joined(m)
    pairs, left_out, asked = [], {}, []
    for j in range(len(pieces)):
        for i in range(j):
            if bodies[i] == bodies[j]:
                continue
            pair, here = (i, j), (links[i], links[j])
            if collisions.pairs is not None:
                if names.match(here, collisions.pairs):
                    pairs.append(pair)
            elif names.match(here, collisions.include):
                pairs.append(pair)
            elif names.match(here, collisions.exclude):
                left_out[pair] = "excluded"
            elif frozenset(here) in disabled:
                left_out[pair] = "disabled in the rig's source"
            elif frozenset((bodies[i], bodies[j])) in joined and SCENERY_NAME not in here:
                left_out[pair] = "joined"
            else:
                asked.append(pair)
    for pair, reason in zip(asked, _reasons(rig, pieces, tuple(asked)), strict=True):
        if reason:
            left_out[pair] = reason
        else:
            pairs.append(pair)
    return Choice(names, pieces, tuple(sorted(pairs, key=lambda pair: (pair[1], pair[0]))), MappingProxyType(left_out))


class Selection:
    """Names, patterns and groups as sets of links."""

    def __init__(self, rig: Rig, collisions: Collisions):
        self._links = [*rig.links, SCENERY_NAME]
        self._groups = {name: self._all(f"group {name!r}", patterns) for name, patterns in collisions.groups.items()}
        self._sets: dict[str, frozenset[str]] = {}
        for where in ("pairs", "include", "exclude", "materials"):
            for pair in getattr(collisions, where) or ():
                for name in pair:
                    self._sets[name] = self._groups.get(name) or self._all(where, [name])

    def match(self, links: Names, pairs: Iterable[Names]) -> bool:
        """Whether these links are one of the pairs."""
        a, b = links
        return any((a in x and b in y) or (a in y and b in x) for x, y in map(self.meant, pairs))

    def meant(self, pair: Names) -> tuple[frozenset[str], frozenset[str]]:
        """The links that each half of a pair stands for."""
        return self._sets[pair[0]], self._sets[pair[1]]

    def _all(self, where: str, patterns: Sequence[str]) -> frozenset[str]:
        found: set[str] = set()
        for pattern in patterns:
            some = [link for link in self._links if link == pattern or fnmatchcase(link, pattern)]
            if not some:
                hint = did_you_mean(pattern, self._links)
                raise ValueError(f"{where}: {pattern!r} is no link, no group, and no pattern that matches any{hint}")
            found |= set(some)
        return frozenset(found)


def _check_given(names: Selection, collisions: Collisions, some: Sequence[tuple[str, int]]) -> None:
    """That each pair that was asked for has two shapes on two bodies."""
    for where, pair in [*(("pairs", x) for x in collisions.pairs or ()), *(("include", x) for x in collisions.include)]:
        ends = [[k for k, (link, _) in enumerate(some) if link in links] for links in names.meant(pair)]
        if not all(ends) or len({*ends[0], *ends[1]}) == 1:
            raise ValueError(f"{where}: {pair!r} has no two shapes that could touch; give these links collision shapes")
        if len({some[k][1] for end in ends for k in end}) == 1:
            raise ValueError(f"{where}: {pair!r} is on one body: its parts never move against each other")


def _joined(m: Mechanism) -> set[frozenset[int]]:
    """Bodies that a joint or a loop joins; not those that float."""
    rig = m.rig
    held = [i for i, joint in enumerate(m.joints) if rig.joints[joint.name].kind not in ("floating", "planar")]
    joined = {frozenset((i, m.parent[i])) for i in held}
    for loop in rig.loops:
        if loop.kind not in ("distance", "gear"):
            ends = (WORLD if is_world(rig, name) else rig.links[str(name)].body for name in (loop.link_a, loop.link_b))
            joined.add(frozenset(ends))
    return joined


@lru_cache(maxsize=64)
def _reasons(rig: Rig, pieces: tuple[Piece, ...], pairs: tuple[tuple[int, int], ...]) -> tuple[str, ...]:
    """Why each pair needs no look; "" if it does."""
    m = mechanism(rig)
    reasons = dict.fromkeys(pairs, "")
    held = [pair for pair in pairs if not _floats(m, *(pieces[k] for k in pair))]
    neutral, asked = tree(m, list(rig.neutral()[None].T)), []
    for pair, gaps in zip(held, _gaps(pieces, held, [neutral] * len(held)), strict=True):
        if gaps.min() < -_TOUCHING * min(pieces[k].reach for k in pair):
            reasons[pair] = "overlap when neutral"
        else:
            asked.append(pair)
    reasons |= dict.fromkeys(_apart(rig, m, pieces, asked), "never touch")
    return tuple(reasons.values())


def _apart(rig: Rig, m: Mechanism, pieces: Sequence[Piece], pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Pairs that touch in no configuration that is found.

    Of many random ones the nearest are brought nearer: one joint after the other takes the place that it has in another one,
    if that is better. So joints stay within their limits.
    """
    rng, pool = np.random.default_rng(_SEED), rig.random(_SEED, _SAMPLES)
    samples, best = tree(m, list(pool.T)), {}
    for pair in pairs:
        middle = [place(samples, pieces[k]).center for k in pair]
        distance = (middle[0] - middle[1]).dot(middle[0] - middle[1])
        nearest = np.argsort(np.broadcast_to(distance, _SAMPLES))[:_CANDIDATES]
        best[pair] = pool[nearest], np.full(_CANDIDATES, np.inf)
    moving = {pair: [m.joints[i] for i in _between(m, *(pieces[k] for k in pair)) if not m.joints[i].follows] for pair in pairs}
    for k in range(_ROUNDS):
        left = [pair for pair in pairs if not _touches(pieces, pair, best[pair][1])]
        tried = {pair: best[pair][0].copy() for pair in left}
        for pair, q in tried.items():
            for row in range(_CANDIDATES if k and moving[pair] else 0):
                joint = moving[pair][rng.integers(len(moving[pair]))]
                q[row, list(joint.q)] = pool[rng.integers(_SAMPLES), list(joint.q)]
        now = tree(m, list(np.concatenate([*tried.values(), pool[:0]]).T))
        cut = [_some(now, slice(n * _CANDIDATES, (n + 1) * _CANDIDATES), m, pieces, pair) for n, pair in enumerate(left)]
        for pair, gaps in zip(left, _gaps(pieces, left, cut), strict=True):
            better = gaps < best[pair][1]
            best[pair] = np.where(better[:, None], tried[pair], best[pair][0]), np.where(better, gaps, best[pair][1])
    return [pair for pair in pairs if not _touches(pieces, pair, best[pair][1])]


def _touches(pieces: Sequence[Piece], pair: tuple[int, int], gaps: np.ndarray) -> bool:
    return bool(gaps.min() < _CLOSE * min(pieces[k].reach for k in pair))


def _floats(m: Mechanism, a: Piece, b: Piece) -> bool:
    """Whether one moves freely against the other."""
    return any(m.rig.joints[m.joints[i].name].kind in ("floating", "planar") for i in _between(m, a, b))


def _between(m: Mechanism, a: Piece, b: Piece) -> set[int]:
    """Bodies whose joints move one piece against the other."""
    return set(m.support(a.body(m))) ^ set(m.support(b.body(m)))


def _some(now: Tree, which: slice, m: Mechanism, pieces: Sequence[Piece], pair: tuple[int, int]) -> Tree:
    """Some of the configurations, as far as a pair needs them."""

    def cut(x: Scalar) -> Scalar:
        return x[which] if isinstance(x, np.ndarray) and x.ndim else x

    X = list(now.X)
    for body in {pieces[k].body(m) for k in pair} - {WORLD}:
        rows = [[cut(x) for x in row] for row in X[body].matrix()[:3]]
        X[body] = Pose(Mat3.of([row[:3] for row in rows]), Vec3.of([row[3] for row in rows]))
    return replace(now, origin=Vec3(*map(cut, now.origin)), X=X)


def _gaps(pieces: Sequence[Piece], pairs: Sequence[tuple[int, int]], each: Sequence[Tree]) -> list[np.ndarray]:
    """The gap of each pair in each of some configurations of its own."""
    shapes = [(place(now, pieces[a]), place(now, pieces[b])) for now, (a, b) in zip(each, pairs, strict=True)]
    return each_meeting(shapes, lambda a, b: least([touch.size for touch in meet(a, b)]))
