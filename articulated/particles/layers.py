"""Elements of laws as chains of particles meet them, place by place: in layers, each of one form and at most one at a place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from articulated.particles.chains import Chains
from articulated.particles.forces.force import Force, Law


@dataclass(frozen=True, eq=False)
class Layer:
    """A law's elements of one form, of which at most one ends at each particle of a chain.

    Attributes:
        law: which.
        behind: how far behind the last of them each of its particles is, as the law orders them.
        there: whether there is one, by chain and place, shape (count, length).
        constants: of these elements, each of shape () or (count, length).
    """

    law: Law
    behind: tuple[int, ...]
    there: np.ndarray
    constants: tuple[np.ndarray, ...]

    @property
    def reach(self) -> int:
        """How far it reaches back."""
        return max(self.behind)

    @property
    def everywhere(self) -> bool:
        """Whether there is one wherever it fits."""
        return bool(self.there[:, self.reach :].all())

    def fixed(self) -> list[np.ndarray]:
        """What a particle has to know of it."""
        given = [c for c in self.constants if c.ndim]
        return given if self.everywhere else [self.there.astype(float), *given]


def layers(chains: Chains, forces: Sequence[Force]) -> list[Layer]:
    """All that acts between particles of chains."""
    found = []
    for law in forces:
        if not isinstance(law, Law) or law.particles is None or not len(law.particles):
            continue
        last = law.particles.max(axis=1)
        behind = last[:, None] - law.particles
        for form in sorted({tuple(row) for row in behind.tolist()}):
            some = np.flatnonzero((behind == form).all(axis=1))
            while len(some):  # what ends at a particle more than once is in as many layers
                _, first = np.unique(last[some], return_index=True)
                found.append(_layer(chains, law, form, some[first], last[some[first]]))
                some = np.delete(some, first)
    return found


def _layer(chains: Chains, law: Law, behind: tuple[int, ...], some: np.ndarray, last: np.ndarray) -> Layer:
    shape = chains.count, chains.length
    there = np.zeros(shape, dtype=bool)
    there.flat[last] = True
    constants = []
    for c in law.constants:
        if c.ndim:
            values = np.full(shape, c[some[0]])
            values.flat[last] = c[some]
            c = values
        constants.append(c)
    return Layer(law, behind, there, tuple(constants))
