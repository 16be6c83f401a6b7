"""Colours of elements: those of one colour share no particle, so that all of them can move theirs at once.

Greedy colouring: each element takes the first colour that none of its neighbours has (Welsh and Powell, 1967). Differs: in the
order in which elements come.
"""

from __future__ import annotations

import numpy as np


def independent(particles: np.ndarray) -> list[np.ndarray]:
    """The numbers of the elements of each colour: no two of one share a particle.

    Args:
        particles: of each element, shape (m, k).
    """
    taken: dict[int, int] = {}  # of each particle, a bit for each colour that it has met
    found: list[list[int]] = []
    for number, some in enumerate(particles.tolist()):
        met = 0
        for particle in some:
            met |= taken.get(particle, 0)
        bit = ~met & (met + 1)  # the lowest that is not set
        for particle in some:
            taken[particle] = taken.get(particle, 0) | bit
        if (colour := bit.bit_length() - 1) == len(found):
            found.append([])
        found[colour].append(number)
    return [np.array(elements) for elements in found]
