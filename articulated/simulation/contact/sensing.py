"""What contacts tell: where they are, and how hard they push."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

import numpy as np

from articulated.compiler import evaluate
from articulated.dynamics.boundary import Argument
from articulated.dynamics.calls import call
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.tree import tree
from articulated.scalar import Nested, either
from articulated.simulation.contact.choosing import name_of
from articulated.simulation.contact.gaps import gaps
from articulated.simulation.contact.meeting import touches
from articulated.simulation.scene import Scene


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a batch at one moment: of points, each with each surface of the ground, then of pairs of shapes; n in all.

    Attributes:
        links: name of the link of each, (n,).
        others: what it may touch, (n,): the name of a link, "scenery", or "" for the ground.
        points: where they are, in the world; of a pair, where it is deepest or nearest, shape (..., n, 3) [m].
        normals: towards the link, of what it may touch, there, shape (..., n, 3).
        gaps: the distance, negative inside, shape (..., n) [m].
        forces: on the link over the last step, in the world, of a pair at all its points, shape (..., n, 3) [N].
    """

    links: tuple[str, ...]
    others: tuple[str, ...]
    points: np.ndarray
    normals: np.ndarray
    gaps: np.ndarray
    forces: np.ndarray

    @property
    def touching(self) -> np.ndarray:
        """Which of them were pushed in the last step, shape (..., n)."""
        return np.einsum("...i,...i", self.forces, self.normals) > 0.0

    def on(self, link: str) -> np.ndarray:
        """The force of all that touches a link, in the world, shape (..., 3) [N]."""
        known = dict.fromkeys(name for name in (*self.links, *self.others) if name)
        if link not in known:
            raise ValueError(f"link {link!r} has no point of contact; there are some on {', '.join(known)}")
        on, by = (np.array([name == link for name in names], dtype=float) for names in (self.links, self.others))
        return np.einsum("...ni,n->...i", self.forces, on - by)


def contact_links(scene: Scene) -> tuple[str, ...]:
    """The name of the link of each contact."""
    names = list(scene.rig.links)
    ground = (names[scene.candidates[scene.candidate_of(n)].link] for n in range(scene.touches))
    return (*ground, *(name_of(scene.rig, scene.pieces[pair.a]) for pair in scene.pairs))


def contact_others(scene: Scene) -> tuple[str, ...]:
    """The name of what each may touch."""
    return (*[""] * scene.touches, *(name_of(scene.rig, scene.pieces[pair.b]) for pair in scene.pairs))


def contact_geometry(scene: Scene, q: np.ndarray) -> np.ndarray:
    """Points, normals and gaps of all contacts, shape (..., n, 7)."""
    n = scene.touches + len(scene.pairs)
    if not n:
        return np.zeros((*q.shape[:-1], 0, 7))
    if scene.tables:  # which compiled functions of a rig are not given
        result = np.empty((*q.shape[:-1], n, 7))
        evaluate(lambda x: _geometry(scene.mechanism, x, _Key(scene)), [(q, 1)], result, q.shape[:-1])
        return result
    given = [Argument("q", q, (scene.rig.nq,))]
    return call(scene.rig, _geometry, given, (n, 7), None, None, watched=False, key=_Key(scene))


class _Key:
    """A scene as a constant of a program: equal where its content is."""

    def __init__(self, scene: Scene):
        self.scene = scene

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.scene.content == self.scene.content

    def __hash__(self) -> int:
        return hash(self.scene.content)

    def __repr__(self) -> str:
        return repr(self.scene.content)


def _geometry(m: Mechanism, q: Nested, key: _Key) -> Nested:
    scene, now = key.scene, tree(key.scene.mechanism, q)
    ground = [[*(now.origin + gap.point), *gap.normal, gap.size] for gap in gaps(scene, now, scene.tables)]
    some, deepest = iter(touches(now, scene.pieces, scene.pairs)), []
    for pair in scene.pairs:
        first, *others = islice(some, scene.points_of(pair))
        for other in others:
            first = either(other.size < first.size, other, first)
        deepest.append([*(now.origin + first.point), *first.normal, first.size])
    return [*ground, *deepest]
