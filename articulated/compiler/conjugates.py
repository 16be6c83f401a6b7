"""Linear implicit steps of nodes on which elements act, by conjugate gradients, all of it in one kernel.

    A δ = b,   A = own blocks of nodes + those of elements,   preconditioned with B, inverses of the blocks on A's diagonal.

A node is a row of eight numbers, as in `meshes`. What elements gather and scatter is in rows of four: the direction p, and
sums. All else of conjugate gradients (Golub and Van Loan, Matrix Computations, 2013, 11.5.1) is in planes: r, δ, z, B and
own blocks. What an element's product with p needs, and is the same for all turns, is found once a step and kept beside it.

Inner products are sums of eight parts, by a node's or an element's number, added up in one order: their bits are those of any
register. p · A p is summed where elements are at work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from articulated.compiler.rows import ROW
from articulated.compiler.straight import Parts, Straight, parted
from articulated.scalar import Scalar

Scalars = Sequence[Scalar]


@dataclass(frozen=True, eq=False)
class Bonds:
    """A law for elements of some nodes.

    Attributes:
        nodes: how many nodes an element has.
        constants: how many numbers belong to each element.
        act: from the rows of its nodes, its constants and the numbers of the step to what it adds to b of each node, three
            numbers, and to its block on the diagonal, six.
        product: likewise, with three numbers p of each node, to what it adds to A p of each.
    """

    nodes: int
    constants: int
    act: Callable[[Sequence[Scalars], Scalars, Scalars], tuple[Sequence[Scalars], Sequence[Scalars]]]
    product: Callable[[Sequence[Scalars], Sequence[Scalars], Scalars, Scalars], Sequence[Scalars]]


@dataclass(frozen=True, eq=False)
class Implicit:
    """Steps of nodes.

    Attributes:
        name: for dumps.
        constants: how many numbers belong to each node besides its row.
        numbers: how many are the same for all, and carried from step to step.
        begin: from a node's row, its constants and the numbers to its own part of b, three numbers, and of A, six.
        bonds: what acts between nodes.
        settle: from a node's row and its block on the diagonal to the inverse of that, six numbers; zeros hold it.
        end: from a node's row, δ, its constants and the numbers to its new row.
        go_on: from the numbers of a step to those of the next.
    """

    name: str
    constants: int
    numbers: int
    begin: Callable[[Scalars, Scalars, Scalars], tuple[Scalars, Scalars]]
    bonds: Sequence[Bonds]
    settle: Callable[[Scalars, Scalars], Scalars]
    end: Callable[[Scalars, Scalars, Scalars, Scalars], Scalars]
    go_on: Callable[[Scalars], Scalars]


@dataclass(frozen=True, eq=False)
class Own:
    """Of which numbers own blocks are made: most are the same, or zero.

    Attributes:
        entries: of each of six the number of its plane, or what it is for all nodes.
        planes: how many.
        first: of each plane one of the six.
    """

    entries: list[int | float]
    planes: int
    first: list[int]

    @staticmethod
    def of(begin: Straight) -> Own:
        """Of what begins a step: b, then blocks."""
        nodes, entries, seen, first = begin.nodes, list[int | float](), dict[int, int](), list[int]()
        for k, i in enumerate(begin.outputs[3:]):
            if nodes[i][0] == "const":
                entries.append(float(nodes[i][1]))
                continue
            if i not in seen:
                seen[i] = len(seen)
                first.append(k)
            entries.append(seen[i])
        return Own(entries, len(seen), first)

    def block(self, planes: Scalars) -> list[Scalar]:
        """A node's block."""
        return [planes[entry] if isinstance(entry, int) else entry for entry in self.entries]


@dataclass(frozen=True, eq=False)
class Passes:
    """All that happens, traced."""

    own: Own
    begin: Straight
    bonds: list[Parts]
    settle: Straight
    sweep: Straight
    turned: Straight
    end: Straight
    go_on: Straight

    @staticmethod
    def of(work: Implicit, single: bool) -> Passes:
        c, n = work.constants, work.numbers

        def begin(x: Scalars) -> Scalars:
            b, blocks = work.begin(x[:ROW], x[ROW : ROW + c], x[ROW + c :])
            return [*b, *blocks]

        first = Straight.of(begin, ROW + c + n, single)
        own = Own.of(first)

        def settle(x: Scalars) -> Scalars:
            """Row, b, diagonal, own planes: B, z, r · z, and p · own p with p = z."""
            b, D, blocks = x[ROW : ROW + 3], x[ROW + 3 : ROW + 9], own.block(x[ROW + 9 :])
            B = work.settle(x[:ROW], D)
            z = _times(B, b)
            return [*B, *z, _dot(b, z), _dot(z, _times(blocks, z))]

        def sweep(x: Scalars) -> Scalars:
            """α, r, δ, p, A p of elements, B, own planes: r, δ, z, r · z."""
            alpha, r, d, p, Ap, B, blocks = x[0], x[1:4], x[4:7], x[7:10], x[10:13], x[13:19], own.block(x[19:])
            whole = [a + b for a, b in zip(Ap, _times(blocks, p), strict=True)]
            r = [a - alpha * b for a, b in zip(r, whole, strict=True)]
            d = [a + alpha * b for a, b in zip(d, p, strict=True)]
            z = _times(B, r)
            return [*r, *d, *z, _dot(r, z)]

        def turned(x: Scalars) -> Scalars:
            """β, z, p, own planes: p, p · own p."""
            p = [z + x[0] * p for z, p in zip(x[1:4], x[4:7], strict=True)]
            return [*p, _dot(p, _times(own.block(x[7:]), p))]

        def end(x: Scalars) -> Scalars:
            return work.end(x[:ROW], x[ROW : ROW + 3], x[ROW + 3 : ROW + 3 + c], x[ROW + 3 + c :])

        return Passes(
            own,
            first,
            [_of_bond(bond, n, single) for bond in work.bonds],
            Straight.of(settle, ROW + 9 + own.planes, single),
            Straight.of(sweep, 19 + own.planes, single),
            Straight.of(turned, 7 + own.planes, single),
            Straight.of(end, ROW + 3 + c + n, single),
            Straight.of(work.go_on, n, single),
        )

    def all(self) -> Iterator[Straight]:
        yield from (self.begin, self.settle, self.sweep, self.turned, self.end, self.go_on)
        for bond in self.bonds:
            yield from (bond.now, bond.later)


def _of_bond(bond: Bonds, n: int, single: bool) -> Parts:
    first, k = bond.constants + n, bond.nodes

    def work(x: Scalars, p: Scalars) -> tuple[Scalars, Scalars]:
        constants, numbers = x[: bond.constants], x[bond.constants : first]
        rows = [x[i : i + ROW] for i in range(first, len(x), ROW)]
        b, D = bond.act(rows, constants, numbers)
        moves = [p[3 * i : 3 * i + 3] for i in range(k)]
        f = bond.product(rows, moves, constants, numbers)
        return [*(c for row in b for c in row), *(c for row in D for c in row)], [c for row in f for c in row]

    return parted(work, first + k * ROW, 3 * k, single)


def _times(S: Scalars, x: Scalars) -> list[Scalar]:
    """A symmetric block, six numbers, times three."""
    return [
        S[0] * x[0] + S[1] * x[1] + S[2] * x[2],
        S[1] * x[0] + S[3] * x[1] + S[4] * x[2],
        S[2] * x[0] + S[4] * x[1] + S[5] * x[2],
    ]


def _dot(a: Scalars, b: Scalars) -> Scalar:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
