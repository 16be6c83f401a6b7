"""Which pairs of links may not collide: what is said of it, one rule after the other, and what follows for a rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.rig.errors import Place


@dataclass(frozen=True)
class CollisionRule:
    """Whether two links may collide; a `link2` of None means all others. The last rule that speaks of a pair counts."""

    link1: str
    link2: str | None
    collide: bool
    place: Place


def disabled_pairs(links: Sequence[str], rules: Sequence[CollisionRule]) -> tuple[tuple[str, str], ...]:
    """Pairs of these links that the rules keep from colliding, in the order of the links.

    Links that do not exist, and links paired with themselves, are skipped and warned of.
    """
    index = {name: i for i, name in enumerate(links)}
    disabled: set[tuple[int, int]] = set()
    strangers: dict[str, dict[str, Place]] = {}
    for rule in rules:
        named = [rule.link1] if rule.link2 is None else [rule.link1, rule.link2]
        if unknown := [name for name in named if name not in index]:
            for name in unknown:
                strangers.setdefault(rule.place.source, {}).setdefault(name, rule.place)
            continue
        if rule.link1 == rule.link2:
            rule.place.warn(f"names link {rule.link1!r} twice, ignored", "shapes of one link never collide; name two links")
            continue
        i = index[rule.link1]
        others = [j for j in range(len(links)) if j != i] if rule.link2 is None else [index[rule.link2]]
        pairs = {(min(i, j), max(i, j)) for j in others}
        if rule.collide:
            disabled -= pairs
        else:
            disabled |= pairs
    for places in strangers.values():
        _warn_of(places)
    return tuple((links[i], links[j]) for i, j in sorted(disabled))


def _warn_of(strangers: dict[str, Place]) -> None:
    """One warning for a source: each link that it should not name, with its line."""
    names = [f"{name!r} (line {place.line})" if place.line else repr(name) for name, place in strangers.items()]
    first = next(iter(strangers.values()))
    first.warn(f"no such links, skipped: {', '.join(names)}", "are their names spelt right?")
