"""Resistance to bending, of strands and cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles.check import elements, in_range, numbers, per_element, settle
from articulated.particles.forces.force import Law
from articulated.particles.points import Point
from articulated.scalar import Scalar
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class Bending(Law):
    """f_i = −w_i (k c + d ċ), with the curvature c = Σ w_i x_i of a few particles: straight, or flat, it is at rest.

    Three in a row have the weights 1, −2, 1. Four of two triangles with a common edge have those of Bergou, Wardetzky, Harmon,
    Zorin and Grinspun, A Quadratic Bending Model for Inextensible Surfaces (2006), equation 3; see `hinge_weights`. Forces are
    linear: what they take to the implicit step is constant and never negative.

    Attributes:
        groups: numbers of particles, shape (m, 3) or (m, 4).
        stiffness: k, a number or one for each element, shape (m,) [N/m; with the weights of hinges N m].
        damping: d [N s/m].
        weights: w, shape (k,) for all elements, or (m, k); they add up to zero. None: 1, −2, 1.
    """

    groups: Any
    stiffness: Any
    damping: Any = 0.0
    weights: Any = None

    def __post_init__(self) -> None:
        size = np.shape(self.groups)[1] if np.ndim(self.groups) == 2 else 3
        some = elements("Bending: groups", self.groups, 4 if size == 4 else 3)
        if self.weights is None and size == 4:
            raise ValueError("Bending: weights are missing; elements of four particles need theirs, see hinge_weights")
        given = (1.0, -2.0, 1.0) if self.weights is None else self.weights
        weights = numbers("Bending: weights", given, (size,) if np.ndim(given) == 1 else (len(some), size))
        if np.abs(weights.sum(axis=-1)).max(initial=0.0) > 1e-9 * np.abs(weights).max(initial=0.0):
            raise ValueError("Bending: weights of an element do not add up to zero: it would pull where nothing is bent")
        settle(
            self,
            groups=some,
            stiffness=per_element("Bending: stiffness", self.stiffness, len(some), "element"),
            damping=per_element("Bending: damping", self.damping, len(some), "element"),
            weights=weights,
        )

    def bound(self, x: np.ndarray, mass: np.ndarray) -> Bending:
        in_range("Bending: groups", self.groups, len(x))
        return self

    @property
    def particles(self) -> np.ndarray:
        return self.groups

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        return self.stiffness, self.damping, *np.moveaxis(self.weights, -1, 0)

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        stiffness, damping, *weights = constants
        f = _weighed([point.x for point in points], weights) * stiffness
        f = f + _weighed([point.v for point in points], weights) * damping
        return [f * -w for w in weights]

    def potential(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Scalar:
        stiffness, _, *weights = constants
        c = _weighed([point.x for point in points], weights)
        return 0.5 * stiffness * c.dot(c)

    def convex_resistance(
        self, t: Scalar, points: Sequence[Point], moves: Sequence[Vec3], h: Scalar, *constants: Scalar
    ) -> Sequence[Vec3]:
        """Exact."""
        stiffness, damping, *weights = constants
        f = _weighed(moves, weights) * (h * damping + h * h * stiffness)
        return [f * w for w in weights]


def hinge_weights(x: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """The weights of flat elements of two triangles with a common edge, for a stiffness per edge in [N m].

    With the cotangents of the four angles at its ends, the curvature is that of the equation above, over the root of the areas
    of the two triangles. Differs: there it is a third of these. But all curvature of a sheet that bends one way is in a third
    of the edges of a regular mesh, of squares with diagonals or of equal sides: so its energy is that of a sheet, k κ²/2 an
    area.

    Args:
        x: where the particles are at rest, shape (n, 3) [m].
        hinges: of each edge its two ends, then the corners opposite to it, shape (m, 4).

    Returns:
        Shape (m, 4) [1/m].

    Raises:
        ValueError: a triangle has no area.
    """
    a, b, c, d = (x[hinges[:, k]] for k in range(4))

    def cotangent(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        double = np.linalg.norm(np.cross(p, q), axis=1)
        if (double <= 1e-12 * np.linalg.norm(p, axis=1) * np.linalg.norm(q, axis=1)).any():
            raise ValueError(f"hinges[{int(np.argmin(double))}] has a triangle without an area; leave it out of the mesh")
        return (p * q).sum(axis=1) / double, double

    at_a_c, double_c = cotangent(b - a, c - a)
    at_b_c, _ = cotangent(a - b, c - b)
    at_a_d, double_d = cotangent(b - a, d - a)
    at_b_d, _ = cotangent(a - b, d - b)
    weights = np.stack([at_b_c + at_b_d, at_a_c + at_a_d, -(at_a_c + at_b_c), -(at_a_d + at_b_d)], axis=1)
    return weights * np.sqrt(2.0 / (double_c + double_d))[:, None]


def _weighed(vectors: Sequence[Vec3], weights: Sequence[Scalar]) -> Vec3:
    total = vectors[0] * weights[0]
    for vector, weight in zip(vectors[1:], weights[1:], strict=True):
        total = total + vector * weight
    return total
