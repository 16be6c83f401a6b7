"""What contacts tell: where they are, and how hard they push."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from articulated.compiler import evaluate
from articulated.dynamics.boundary import Argument
from articulated.dynamics.calls import call
from articulated.dynamics.mechanism import Mechanism
from articulated.dynamics.tree import tree
from articulated.scalar import Nested
from articulated.simulation.contact.gaps import gaps
from articulated.simulation.scene import Scene


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a batch at one moment; n points, each with each surface of the ground.

    Attributes:
        links: name of the link of each point, (n,).
        points: where they are, in the world, shape (..., n, 3) [m].
        normals: of the ground there, shape (..., n, 3).
        gaps: their distance from the ground, negative inside, shape (..., n) [m].
        forces: of the ground on them over the last step, in the world, shape (..., n, 3) [N].
    """

    links: tuple[str, ...]
    points: np.ndarray
    normals: np.ndarray
    gaps: np.ndarray
    forces: np.ndarray

    @property
    def touching(self) -> np.ndarray:
        """Which of them the ground pushed in the last step, shape (..., n)."""
        return np.einsum("...i,...i", self.forces, self.normals) > 0.0

    def on(self, link: str) -> np.ndarray:
        """The force of the ground on a link, in the world, shape (..., 3) [N]."""
        if link not in self.links:
            raise ValueError(f"link {link!r} has no point of contact; there are some on {', '.join(dict.fromkeys(self.links))}")
        return self.forces[..., [name == link for name in self.links], :].sum(axis=-2)


def contact_links(scene: Scene) -> tuple[str, ...]:
    """The name of the link of each contact."""
    names = list(scene.rig.links)
    return tuple(names[scene.candidates[scene.candidate_of(n)].link] for n in range(scene.touches))


def contact_geometry(scene: Scene, q: np.ndarray) -> np.ndarray:
    """Points, normals and gaps of all contacts, shape (..., n, 7)."""
    if not scene.touches:
        return np.zeros((*q.shape[:-1], 0, 7))
    if scene.tables:  # which compiled functions of a rig are not given
        result = np.empty((*q.shape[:-1], scene.touches, 7))
        evaluate(lambda x: _geometry(scene.mechanism, x, _Key(scene)), [(q, 1)], result, q.shape[:-1])
        return result
    given = [Argument("q", q, (scene.rig.nq,))]
    return call(scene.rig, _geometry, given, (scene.touches, 7), None, None, watched=False, key=_Key(scene))


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
    now = tree(key.scene.mechanism, q)
    return [[*(now.origin + gap.point), *gap.normal, gap.size] for gap in gaps(key.scene, now, key.scene.tables)]
