"""A symmetric system of few unknowns, unrolled: LDLᵀ with the fill that its pattern of zeros has, and no branch.

symbol   meaning
Λ        J M⁻¹ Jᵀ: how much velocity along one row an impulse along another gives; singular where rows repeat each other
μ        what is added to its diagonal: a part of the diagonal's mean, far above rounding
P        of each loop, what of its rows no motion has: μ (Λ + μ)⁻¹ of its own block with a smaller μ: 1 there, 0 elsewhere

A solution of (Λ + μ) x = b is corrected by those for what it leaves of Λ x = b: the proximal point method, which converges
where Λ is singular too, to the solution nearest to 0. Carpentier, Budhiraja, Mansard, Proximal and Sparse Resolution of
Constrained Dynamic Equations, RSS 2021. Two corrections are made.

A planar loop of five rows repeats three of them where it is closed; where it is a little open, it does so only nearly, and
would ask for the impossible. So P, as it is where loops are closed, goes into Λ as well: along it nothing pulls. What loops
repeat of each other is left to the rows that come first: later ones, of which these leave nothing, are idle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from articulated.scalar import Scalar, is_zero, reciprocal, rounding, where

CORRECTIONS = 2
_POWER = 2.0 / 3.0
"""μ is rounding to this power: 4e-11 in float64."""
_SHARP = 0.9
"""And that of P to this one: 8e-15. A milliradian from a singular place Λ has entries of 1e-6: these are not nothing."""
_IDLE = 10.0
"""A row is idle if others leave less than this part of its own entry, times rounding to that power."""

Pair = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Redundancy:
    """What rows repeat of each other: see above.

    Attributes:
        P: of all loops, entry by entry of their blocks' upper triangles, each times its block's mean.
        idle: of each row 1 or 0.
    """

    P: list[Scalar]
    idle: list[Scalar]


class Factor:
    """(Λ + μ), factored.

    Attributes:
        matrix: Λ, as entries (j, k) with j ≤ k; those left out are 0.
        order: in which its unknowns are eliminated: those with the fewest neighbours first, so that chains have no fill.
        redundancy: of its rows.
    """

    def __init__(
        self,
        matrix: Mapping[Pair, Scalar],
        sizes: Sequence[int],
        soft: Mapping[int, Scalar] | None = None,
        known: Redundancy | None = None,
        leaves_out: bool = True,
    ):
        """Factor a matrix for loops of so many rows each.

        Args:
            matrix: Λ.
            sizes: rows of each loop.
            soft: what is added to its diagonal.
            known: how rows repeat each other; None to find it out here, where loops are closed.
            leaves_out: whether idle rows get nothing, rather than their share.
        """
        n = self.n = sum(sizes)
        self.matrix = {pair: x for pair, x in matrix.items() if not is_zero(x)}
        diagonal = [self.matrix.get((k, k), 0.0) for k in range(n)]
        mean = sum(diagonal, 0.0) * (1.0 / n) if n else 0.0
        sharp = rounding(mean) ** _SHARP
        mu = mean * rounding(mean) ** _POWER
        pairs = list(_blocks(sizes))
        P = _unmoved(self.matrix, sizes, mean * sharp) if known is None else known.P
        for k, x in (soft or {}).items():
            self.matrix[k, k] = self.matrix.get((k, k), 0.0) + x
        held = dict(self.matrix)
        for pair, x in zip(pairs, P, strict=True):
            held[pair] = held.get(pair, 0.0) + x
        self.order = elimination_order((pair for pair, x in held.items() if not is_zero(x)), n)
        place = {k: i for i, k in enumerate(self.order)}
        A: list[dict[int, Scalar]] = [{} for _ in range(n)]  # of each in turn, those after it
        for (j, k), x in held.items():
            if j != k and not is_zero(x):
                a, b = sorted((place[j], place[k]))
                A[a][b] = x
        own = [held.get((k, k), 0.0) for k in self.order]
        D, idle = list(own), [0.0] * n
        self._Dinv: list[Scalar] = [0.0] * n
        self._L: list[dict[int, Scalar]] = [{} for _ in range(n)]
        for i, k in enumerate(self.order):
            idle[k] = where(D[i] < own[i] * (_IDLE * sharp), 1.0, 0.0) if known is None else known.idle[k]
            pivot = D[i] + mu
            Dinv = 0.0 if is_zero(pivot) else reciprocal(pivot)
            self._Dinv[i] = where(idle[k] > 0.5, 0.0, Dinv) if leaves_out else Dinv
            self._L[i] = {j: x * self._Dinv[i] for j, x in A[i].items()}
            after = sorted(A[i])
            for at, j in enumerate(after):
                D[j] = D[j] - self._L[i][j] * A[i][j]
                for m in after[at + 1 :]:
                    A[j][m] = A[j].get(m, 0.0) - self._L[i][j] * A[i][m]
        self.redundancy = Redundancy(P, idle)

    def solve(self, b: Sequence[Scalar], corrections: int = CORRECTIONS) -> list[Scalar]:
        """x with Λ x = b, or what comes nearest."""
        x = self._once(b)
        for _ in range(corrections):
            left = [p - r for p, r in zip(b, self.times(x), strict=True)]
            x = [p + dx for p, dx in zip(x, self._once(left), strict=True)]
        return x

    def times(self, x: Sequence[Scalar]) -> list[Scalar]:
        """Λ x."""
        result: list[Scalar] = [0.0] * self.n
        for (j, k), a in self.matrix.items():
            result[j] = result[j] + a * x[k]
            if j != k:
                result[k] = result[k] + a * x[j]
        return result

    def _once(self, b: Sequence[Scalar]) -> list[Scalar]:
        y = [b[k] for k in self.order]
        for i, column in enumerate(self._L):
            for j, l in column.items():
                y[j] = y[j] - l * y[i]
        y = [x * d for x, d in zip(y, self._Dinv, strict=True)]
        for i in reversed(range(self.n)):
            for j, l in self._L[i].items():
                y[i] = y[i] - l * y[j]
        result: list[Scalar] = [0.0] * self.n
        for k, x in zip(self.order, y, strict=True):
            result[k] = x
        return result


def entries(sizes: Sequence[int]) -> int:
    """How many numbers P has."""
    return len(list(_blocks(sizes)))


def _blocks(sizes: Sequence[int]) -> Iterable[Pair]:
    """The entries of all loops' own blocks."""
    first = 0
    for size in sizes:
        yield from ((first + j, first + k) for j in range(size) for k in range(j, size))
        first += size


def _unmoved(matrix: Mapping[Pair, Scalar], sizes: Sequence[int], mu: Scalar) -> list[Scalar]:
    """P, times the mean of each block's diagonal."""
    result, first = [], 0
    for size in sizes:
        rows = range(first, first + size)
        block = [[matrix.get((min(j, k), max(j, k)), 0.0) for k in rows] for j in rows]
        mean = sum((block[j][j] for j in range(size)), 0.0) * (1.0 / size)
        for j in range(size):
            block[j][j] = block[j][j] + mu
        inverse, weight = _inverse(block), mu * mean
        result += [weight * inverse[j][k] for j in range(size) for k in range(j, size)]
        first += size
    return result


def _inverse(A: list[list[Scalar]]) -> list[list[Scalar]]:
    """Of a symmetric positive definite matrix, by exchanging each row in turn with its unknown."""
    n = len(A)
    A = [list(row) for row in A]
    for p in range(n):
        d = 0.0 if is_zero(A[p][p]) else reciprocal(A[p][p])
        scaled = [x * d for x in A[p]]
        for j in range(n):
            for k in range(j, n):
                if p not in (j, k):
                    A[j][k] = A[k][j] = A[j][k] - A[j][p] * scaled[k]
        for k in range(n):
            if k != p:
                A[p][k] = A[k][p] = scaled[k]
        A[p][p] = -d
    return [[-x for x in row] for row in A]


def elimination_order(pairs: Iterable[Pair], n: int) -> list[int]:
    """An order of n unknowns, those with the fewest neighbours first, for a matrix with entries at these pairs."""
    neighbours: dict[int, set[int]] = {k: set() for k in range(n)}
    for j, k in pairs:
        if j != k:
            neighbours[j].add(k)
            neighbours[k].add(j)
    order = []
    while neighbours:
        k = min(neighbours, key=lambda k: (len(neighbours[k]), k))
        around = neighbours.pop(k)
        for j in around:
            neighbours[j] |= around
            neighbours[j] -= {j, k}
        order.append(k)
    return order
