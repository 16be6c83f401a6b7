"""What acts on particles: one small interface for all, and laws over scalars that fulfil it.

With D = −∂f/∂v and K = −∂f/∂x an implicit step of length h needs products (h D + h² K) p (Baraff and Witkin, Large Steps in
Cloth Simulation, 1998, equation 16), and their diagonal blocks to precondition with. A law says what a few particles do to each
other, as plain Python over scalars; all else follows from it, derivatives by dual numbers.

symbol   meaning
n        number of particles
k, m     particles of an element, number of elements
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Self

import numpy as np

from articulated.particles.dual import changes
from articulated.particles.points import Point, vectors
from articulated.scalar import Scalar, absolute, maximum
from articulated.spatial import Mat3, Vec3


class Force(ABC):
    """Something that acts on particles.

    In all methods t is the time [s], x are positions and v velocities in the world, shape (n, 3) [m, m/s], mass is the mass
    of each particle, shape (n,) [kg], and h a step's length [s].
    """

    def bound(self, x: np.ndarray, mass: np.ndarray) -> Self:
        """The force as it acts on these particles, what was left open filled in.

        Raises:
            ValueError: it does not fit them.
        """
        return self

    @abstractmethod
    def force(self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray) -> np.ndarray:
        """On each particle, shape (n, 3) [N]."""

    @property
    def conservative(self) -> bool:
        """Whether what it does to particles at rest is minus the gradient of its energy."""
        return False

    def energy(self, t: float, x: np.ndarray, mass: np.ndarray) -> float:
        """Potential energy, if it has one [J]."""
        return 0.0

    def product(
        self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray, p: np.ndarray, h: float, convex: bool = False
    ) -> np.ndarray:
        """(h D + h² K) p, shape (n, 3).

        Args:
            p: shape (n, 3).
            convex: take something symmetric and positive semidefinite in its place, as near as is known; what solvers need.
        """
        return np.zeros_like(x)

    def diagonal(self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray, h: float, convex: bool = False) -> np.ndarray:
        """The blocks of h D + h² K on its diagonal, shape (n, 3, 3)."""
        return np.zeros((len(x), 3, 3))


class Law(Force):
    """A force that is the same law for each of many elements of a few particles."""

    @property
    def particles(self) -> np.ndarray | None:
        """The numbers of each element's particles, shape (m, k); None: each particle is an element."""
        return None

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        """What the law needs to know of each element, each of shape () or (m,)."""
        return ()

    @property
    def conservative(self) -> bool:
        return type(self).potential is not Law.potential

    def constants_of(self, given: Iterator[Scalar]) -> list[Scalar]:
        """Its constants for one element: those that are the same for all, and the next of those that elements are given."""
        return [next(given) if c.ndim else float(c) for c in self.constants]

    @abstractmethod
    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        """The force on each particle of an element, over scalars [N]."""

    def potential(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Scalar:
        """The potential energy of an element, over scalars [J]."""
        return 0.0

    def resistance(
        self, t: Scalar, points: Sequence[Point], moves: Sequence[Vec3], h: Scalar, *constants: Scalar
    ) -> Sequence[Vec3]:
        """(h D + h² K) p of an element, whose particles have p in `moves`."""

        def pull(given: list[Any]) -> list[Vec3]:
            some, t, *rest = given
            return list(self.pull(t, some, *rest))

        along = [c for p in moves for c in (*(p * (h * h)), *(p * h), 0.0)]
        found = changes(pull, [list(points), t, *constants], [*along, 0.0, *[0.0] * len(constants)])
        return [-f for f in found]

    def convex_resistance(
        self, t: Scalar, points: Sequence[Point], moves: Sequence[Vec3], h: Scalar, *constants: Scalar
    ) -> Sequence[Vec3]:
        """As `resistance`, of a matrix that is symmetric and positive semidefinite.

        Here it is the symmetric part, of which each diagonal entry is raised to the sum of the others in its row, if it is less
        (Gershgorin: Golub and Van Loan, Matrix Computations, 2013, 7.2.1).
        """
        columns = [self.resistance(t, points, unit, h, *constants) for unit in _units(len(points))]
        A = [[c for f in column for c in f] for column in columns]
        size = len(A)
        S = [[0.5 * (A[a][b] + A[b][a]) for b in range(size)] for a in range(size)]
        for a, row in enumerate(S):
            row[a] = maximum(row[a], sum((absolute(row[b]) for b in range(size) if b != a), 0.0))
        p = [c for move in moves for c in move]
        product = [sum((s * c for s, c in zip(row, p, strict=True)), 0.0) for row in S]
        return [Vec3.of(product[k : k + 3]) for k in range(0, size, 3)]

    def force(self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray) -> np.ndarray:
        return self._summed(self.pull(t, self._points(x, v, mass), *self.constants), len(x))

    def energy(self, t: float, x: np.ndarray, mass: np.ndarray) -> float:
        potential = self.potential(t, self._points(x, np.zeros_like(x), mass), *self.constants)
        return float(np.sum(np.broadcast_to(potential, len(self._numbers(len(x))))))

    def product(
        self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray, p: np.ndarray, h: float, convex: bool = False
    ) -> np.ndarray:
        change = self.convex_resistance if convex else self.resistance
        moves = [vectors(p[some]) for some in self._numbers(len(x)).T]
        return self._summed(change(t, self._points(x, v, mass), moves, h, *self.constants), len(x))

    def diagonal(self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray, h: float, convex: bool = False) -> np.ndarray:
        change, points = self.convex_resistance if convex else self.resistance, self._points(x, v, mass)
        found = [change(t, points, unit, h, *self.constants) for unit in _units(len(points))]
        columns = [self._summed([found[3 * n + k][n] for n in range(len(points))], len(x)) for k in range(3)]
        return np.stack(columns, axis=-1)

    def matrices(self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray, h: float) -> np.ndarray:
        """What `product` multiplies with to be convex, of each element: shape (m, k, k, 3, 3), rows first."""
        numbers, points = self._numbers(len(x)), self._points(x, v, mass)
        (m, k), units = numbers.shape, _units(numbers.shape[1])
        result = np.empty((m, k, k, 3, 3))
        for n, unit in enumerate(units):
            for a, f in enumerate(self.convex_resistance(t, points, unit, h, *self.constants)):
                for c, part in enumerate(f):
                    result[:, a, n // 3, c, n % 3] = part
        return result

    def _numbers(self, n: int) -> np.ndarray:
        return np.arange(n)[:, None] if self.particles is None else self.particles

    def _points(self, x: np.ndarray, v: np.ndarray, mass: np.ndarray) -> list[Point]:
        return [Point(vectors(x[some]), vectors(v[some]), mass[some]) for some in self._numbers(len(x)).T]

    def _summed(self, forces: Sequence[Vec3], n: int) -> np.ndarray:
        """What elements do to particles, those of all elements of one kind after the other."""
        numbers, result = self._numbers(n), np.zeros((n, 3))
        for some, force in zip(numbers.T, forces, strict=True):
            for k, part in enumerate(force):
                result[:, k] += np.bincount(some, np.broadcast_to(part, len(some)), n)
        return result


def _units(count: int) -> list[list[Vec3]]:
    """Of so many particles, each moved along each axis."""
    return [[axis if k == n else Vec3.zero() for k in range(count)] for n in range(count) for axis in Mat3.identity().rows]
