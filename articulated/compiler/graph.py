"""Programs as expression graphs. Running an algorithm on `Traced` scalars writes it down, one node an operation.

Nodes are hash-consed: the same operation on the same operands is one node. Constants fold, and what folds away is never
written: x·0, x·1, x + 0, −(−x), a − a, a + (b − a), a·(1/a). Signs are gathered on the way, −a·b as −(a·b), until they meet
in the sign of a fused multiply-add, where they cost nothing. Like every such compiler this takes values to be finite when it
drops x·0.

node              meaning                                          node                 meaning
const x           a number                                         lt le eq a b, and    masks
input a k         scalar k of argument a                           select m a b         a where the mask m holds, else b
row l a k         the same of a row, one row a turn of loop l      bit n a              mask: bit n of the number's pattern
add sub mul div   a + b, a − b, a b, a / b                         power2 a             2^k for a = magic + k (see elementary)
neg abs sqrt same −a, |a|, √a, a                                     exponent, fraction   of a = fraction 2^exponent, ½√2 … √2
fma a b c         a b + c, rounded once (chosen by the schedule)   carried, after l k   what loop l carries: in it, after it
loop l            where loop l stands                              lookup t a           entry a of table t
column l k        column k of the row that loop l is at            yield l r k          what it made of row r: its k-th number
given n m a b     as select m a b, of branch n: see branches
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from articulated.compiler import elementary
from articulated.scalar import Nested, Scalar, flatten, rebuilt

Node = tuple[Any, ...]
LEAVES = frozenset(("const", "input", "row", "carried", "after", "loop", "column", "yield"))
MASKS = frozenset(("lt", "le", "eq", "and", "bit"))


@dataclass(frozen=True)
class Parameter:
    """An integer that a kernel is told at every call, such as the number of turns of a loop."""

    index: int


@dataclass(eq=False)
class Loop:
    """A part of a program that runs again and again: a region of its graph.

    Attributes:
        region: its own, counted from 1 (0 is the program's).
        parent: the region that it stands in.
        count: how many turns it takes at most.
        carried, following: nodes of what it carries, at the start of a turn and at its end.
        initial: nodes of what it starts with.
        until: mask node, known at the start of a turn: a state for which it holds takes no more turns.
        records: what each turn writes to its row of an output: output, scalar, node.
        end: the node after which it stands in its parent.
        columns: of a loop over rows, the nodes of each column, one a turn.
        yields: and those of what it makes of a row.
    """

    region: int
    parent: int
    count: int | Parameter
    carried: list[int]
    initial: list[int]
    following: list[int] = field(default_factory=list)
    until: int | None = None
    records: list[tuple[int, int, int]] = field(default_factory=list)
    end: int = -1
    columns: list[tuple[int, ...]] = field(default_factory=list)
    yields: list[int] = field(default_factory=list)

    def always(self) -> Iterator[int]:
        """The nodes that a turn needs, whatever is wanted of the loop: the mask first."""
        if self.until is not None:
            yield self.until
        yield from (node for _, _, node in self.records)

    def results(self) -> Iterator[int]:
        """The nodes that a turn is for, the mask first."""
        yield from self.always()
        yield from self.following
        yield from self.yields


def operands(node: Node) -> Node:
    """The nodes that a node is computed from."""
    op = node[0]
    return () if op in LEAVES else node[2:] if op in ("bit", "lookup", "given") else node[1:]


class Graph:
    """The nodes of one program; a node's operands come before it.

    Attributes:
        single: whether it is for float32: elementary functions differ.
        nodes: an operation's name and its operands, which are indices of nodes.
        region: for each node the loop that it must be computed again in at every turn, 0 for none.
        loops: all loops; that of region r is at r - 1.
        open: the region that is being written.
        written: nodes whose order is to stay, each with the number of the passage that it is in.
    """

    def __init__(self, single: bool = False):
        self.single = single
        self.nodes: list[Node] = []
        self.region: list[int] = []
        self.loops: list[Loop] = []
        self.open = 0
        self.written: dict[int, int] = {}
        self._passage = self._passages = 0
        self._branches = 0
        self._known: dict[Node, int] = {}

    def node(self, *node: Any) -> int:
        """The index of a node, new or known."""
        index = self._known.get(node)
        if index is None:
            index = self._known[node] = len(self.nodes)
            self.nodes.append(node)
            self.region.append(self._region_of(node))
            if self._passage and node[0] not in LEAVES:
                self.written[index] = self._passage
        return index

    def as_written(self, value: Callable[[], Any]) -> Any:
        """What it returns; the nodes that it writes stay in their order."""
        self._passages += 1
        self._passage = self._passages
        try:
            return value()
        finally:
            self._passage = 0

    def constant(self, x: float) -> int:
        return self.node("const", math.nan if x != x else float(x) + 0.0)

    def scalar(self, index: int) -> Scalar:
        """What algorithms compute with: a number if the node is a constant."""
        node = self.nodes[index]
        return node[1] if node[0] == "const" else Traced(self, index)

    def loop(
        self,
        count: int | Parameter,
        carry: Sequence[int],
        body: Callable[[list[int]], Sequence[int]],
        until: Callable[[list[int]], int] | None,
    ) -> list[int]:
        """Write a loop: its body once, from the nodes of what it carries to those of the next turn."""
        loop = Loop(len(self.loops) + 1, self.open, count, [], list(carry))
        self.loops.append(loop)
        self.open = loop.region
        loop.carried = [self.node("carried", loop.region, k) for k in range(len(carry))]
        if until is not None:
            loop.until = until(loop.carried)
        loop.following = list(body(loop.carried))
        self.open = loop.parent
        loop.end = self.node("loop", loop.region)
        return [self.node("after", loop.region, k) for k in range(len(carry))]

    def each(
        self,
        rows: Sequence[Sequence[int]],
        carry: Sequence[int],
        body: Callable[[list[int], list[int]], tuple[Sequence[int], Sequence[int]]],
    ) -> tuple[list[list[int]], list[int]]:
        """Write a loop over rows, which also carries something from row to row.

        Its body is written once: from the nodes of a row, and of what is carried, to those of what is made of the row, and of
        what is carried on. Returned are what is made of all rows, and what the last one carries on.
        """
        loop = Loop(len(self.loops) + 1, self.open, len(rows), [], list(carry))
        self.loops.append(loop)
        self.open = loop.region
        loop.carried = [self.node("carried", loop.region, k) for k in range(len(carry))]
        entries = []
        for column in zip(*rows, strict=True):
            if len(set(column)) == 1:
                entries.append(column[0])
            else:
                assert not any(self.nodes[i][0] in MASKS for i in column), "masks are no numbers"
                entries.append(self.node("column", loop.region, len(loop.columns)))
                loop.columns.append(column)
        made, following = body(entries, loop.carried)
        loop.yields, loop.following = list(made), list(following)
        self.open = loop.parent
        loop.end = self.node("loop", loop.region)

        def result(r: int, k: int) -> int:
            made = loop.yields[k]
            return self.node("yield", loop.region, r, k) if self.region[made] == loop.region else made

        after = [self.node("after", loop.region, k) for k in range(len(carry))]
        return [[result(r, k) for k in range(len(loop.yields))] for r in range(len(rows))], after

    def _region_of(self, node: Node) -> int:
        op = node[0]
        if op in ("row", "carried", "column"):
            return node[1]
        if op in ("after", "loop", "yield"):
            return self.loops[node[1] - 1].parent
        # loops are nested, and a loop inside another is the younger
        return max((self.region[a] for a in operands(node)), default=0)

    # operations on indices: each is a table of what folds away

    def add(self, a: int, b: int) -> int:
        x, y = self.nodes[a], self.nodes[b]
        if x[0] == "const":
            a, b, x, y = b, a, y, x
        if y[0] == "const":
            if x[0] == "const":
                return self.constant(x[1] + y[1])
            if y[1] == 0.0:
                return a
            if y[1] < 0.0:
                return self.node("sub", a, self.constant(-y[1]))
        if y[0] == "neg":
            return self.sub(a, y[1])
        if x[0] == "neg":
            return self.sub(b, x[1])
        if y[0] == "sub" and y[2] == a:
            return y[1]
        if x[0] == "sub" and x[2] == b:
            return x[1]
        known = self._known.get(("add", b, a))
        return self.node("add", a, b) if known is None else known  # the order stays: a product that stands last is fused

    def sub(self, a: int, b: int) -> int:
        x, y = self.nodes[a], self.nodes[b]
        if y[0] == "const":
            return self.add(a, self.constant(-y[1]))
        if a == b:
            return self.constant(0.0)
        if y[0] == "neg":
            return self.add(a, y[1])
        if x[0] == "const" and x[1] == 0.0:
            return self.neg(b)
        if x[0] == "neg":
            return self.neg(self.add(x[1], b))
        return self.node("sub", a, b)

    def mul(self, a: int, b: int) -> int:
        x, y = self.nodes[a], self.nodes[b]
        if x[0] == "const":
            a, b, x, y = b, a, y, x
        if x[0] == "neg":
            return self.neg(self.mul(x[1], b))
        if y[0] == "neg":
            return self.neg(self.mul(a, y[1]))
        if y[0] == "const":
            c = y[1]
            if x[0] == "const":
                return self.constant(x[1] * c)
            if c == 0.0 or c == 1.0:
                return a if c else self.constant(0.0)
            if c < 0.0:
                return self.neg(self.mul(a, self.constant(-c)))
            if x[0] == "mul" and self.nodes[x[2]][0] == "const":
                return self.mul(x[1], self.constant(self.nodes[x[2]][1] * c))
            return self.node("mul", a, b)  # constants stand last
        for quotient, divisor in ((y, a), (x, b)):
            if quotient[0] == "div" and quotient[2] == divisor and self.nodes[quotient[1]][0] == "const":
                return quotient[1]
        return self.node("mul", a, b) if a <= b else self.node("mul", b, a)

    def div(self, a: int, b: int) -> int:
        x, y = self.nodes[a], self.nodes[b]
        if y[0] == "const" and y[1] != 0.0:
            return self.mul(a, self.constant(1.0 / y[1]))
        if x[0] == "const" and x[1] == 0.0:
            return a
        if x[0] == "neg":
            return self.neg(self.div(x[1], b))
        if y[0] == "neg":
            return self.neg(self.div(a, y[1]))
        if x[0] == "const" and x[1] != 1.0:
            return self.mul(self.div(self.constant(1.0), b), a)
        return self.node("div", a, b)

    def neg(self, a: int) -> int:
        x = self.nodes[a]
        if x[0] == "const":
            return self.constant(-x[1])
        if x[0] == "neg":
            return x[1]
        if x[0] == "sub":
            return self.node("sub", x[2], x[1])
        return self.node("neg", a)

    def absolute(self, a: int) -> int:
        x = self.nodes[a]
        if x[0] == "const":
            return self.constant(abs(x[1]))
        return self.node("abs", x[1]) if x[0] == "neg" else a if x[0] == "abs" else self.node("abs", a)

    def sqrt(self, a: int) -> int:
        x = self.nodes[a]
        return self.constant(math.sqrt(x[1])) if x[0] == "const" else self.node("sqrt", a)

    def select(self, mask: int, a: int, b: int) -> int:
        return a if a == b else self.node("select", mask, a, b)

    def given(self, mask: int, some: Sequence[int], others: Sequence[int]) -> list[int]:
        """As `select`, for one branch."""
        self._branches += 1
        return [a if a == b else self.node("given", self._branches, mask, a, b) for a, b in zip(some, others, strict=True)]


def _binary(name: str):
    def forward(self: Traced, other: Any) -> Scalar:
        graph = self.graph
        return graph.scalar(getattr(graph, name)(self.index, self.index_of(other)))

    def backward(self: Traced, other: Any) -> Scalar:
        graph = self.graph
        return graph.scalar(getattr(graph, name)(self.index_of(other), self.index))

    return forward, backward


def _comparison(name: str, swapped: bool = False):
    def compare(self: Traced, other: Any) -> Traced:
        a, b = self.index, self.index_of(other)
        return Traced(self.graph, self.graph.node(name, *((b, a) if swapped else (a, b))))

    return compare


class Traced:
    """A scalar that writes down what is done with it. It has no value: asking for one is an error in an algorithm."""

    __slots__ = ("graph", "index")
    __array_ufunc__ = None
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, graph: Graph, index: int):
        self.graph, self.index = graph, index

    def index_of(self, x: Any) -> int:
        """The node of another operand, in this one's graph."""
        return x.index if type(x) is Traced else self.graph.constant(x)

    def __bool__(self):
        raise TypeError("a traced scalar has no value to branch on; choose with scalar.where")

    __add__, __radd__ = _binary("add")
    __sub__, __rsub__ = _binary("sub")
    __mul__, __rmul__ = _binary("mul")
    __truediv__, __rtruediv__ = _binary("div")
    __lt__, __gt__ = _comparison("lt"), _comparison("lt", swapped=True)
    __le__, __ge__ = _comparison("le"), _comparison("le", swapped=True)
    __eq__ = _comparison("eq")  # type: ignore[assignment]

    def __and__(self, other: Any) -> Scalar:
        if isinstance(other, Traced):
            return Traced(self.graph, self.graph.node("and", self.index, other.index))
        return self if other else False

    __rand__ = __and__

    def __neg__(self) -> Scalar:
        return self.graph.scalar(self.graph.neg(self.index))

    def absolute(self) -> Scalar:
        return self.graph.scalar(self.graph.absolute(self.index))

    def sqrt(self) -> Scalar:
        return self.graph.scalar(self.graph.sqrt(self.index))

    def nearest(self) -> Scalar:
        return elementary.nearest(self, self.graph.single)

    @property
    def rounding(self) -> float:
        """See `scalar.rounding`."""
        return 2.0**-23 if self.graph.single else 2.0**-52

    def unfolded(self, x: Scalar) -> Traced:
        """A scalar that takes part in no simplification."""
        return Traced(self.graph, self.graph.node("same", self.index_of(x)))

    def as_written(self, value: Callable[[], Nested]) -> Nested:
        """See `scalar.as_written`."""
        return self.graph.as_written(value)

    def where(self, a: Scalar, b: Scalar) -> Scalar:
        """`a` where this mask holds, else `b`."""
        return self.graph.scalar(self.graph.select(self.index, self.index_of(a), self.index_of(b)))

    def given(self, value: Callable[[], Nested], otherwise: Nested) -> Nested:
        """See `scalar.given`."""
        some, others = ([self.index_of(x) for x in flatten(part)] for part in (value(), otherwise))
        return rebuilt(otherwise, iter([self.graph.scalar(i) for i in self.graph.given(self.index, some, others)]))

    def repeat(
        self,
        count: int | Parameter,
        body: Callable[[Nested], Nested],
        carry: Nested,
        until: Callable[[Nested], Traced] | None,
    ) -> Nested:
        """See `scalar.repeat`."""
        graph = self.graph

        def nested(nodes: Sequence[int]) -> Nested:
            return rebuilt(carry, iter([Traced(graph, i) for i in nodes]))

        after = graph.loop(
            count,
            [self.index_of(x) for x in flatten(carry)],
            lambda nodes: [self.index_of(x) for x in flatten(body(nested(nodes)))],
            None if until is None else lambda nodes: until(nested(nodes)).index,
        )
        return nested(after)

    def each(self, rows: Sequence[Nested], body: Callable[[Nested], Nested]) -> list[Nested]:
        """See `scalar.each`."""
        graph, made = self.graph, None

        def of_nodes(nodes: list[int], _: list[int]) -> tuple[list[int], list[int]]:
            nonlocal made
            made = body(rebuilt(rows[0], iter([graph.scalar(i) for i in nodes])))
            return [self.index_of(x) for x in flatten(made)], []

        results, _ = graph.each([[self.index_of(x) for x in flatten(row)] for row in rows], [], of_nodes)
        return [rebuilt(made, iter([graph.scalar(i) for i in row])) for row in results]

    def fold(self, rows: Sequence[Nested], body: Callable[[Nested, Nested], Nested], carry: Nested) -> Nested:
        """See `scalar.fold`."""
        graph = self.graph

        def of_nodes(nodes: list[int], carried: list[int]) -> tuple[list[int], list[int]]:
            row = rebuilt(rows[0], iter([graph.scalar(i) for i in nodes]))
            end = body(rebuilt(carry, iter([Traced(graph, i) for i in carried])), row)
            return [], [self.index_of(x) for x in flatten(end)]

        numbers = [[self.index_of(x) for x in flatten(row)] for row in rows]
        _, after = graph.each(numbers, [self.index_of(x) for x in flatten(carry)], of_nodes)
        return rebuilt(carry, iter([Traced(graph, i) for i in after]))

    def of(self, name: str, *operands: Any) -> Traced:
        """A node that only elementary functions use: fma, bit, power2, exponent, fraction."""
        indices = [x if isinstance(x, int) else self.index_of(x) for x in operands]
        return Traced(self.graph, self.graph.node(name, *indices))

    def sin(self) -> Scalar:
        return elementary.sin(self, self.graph.single)

    def cos(self) -> Scalar:
        return elementary.cos(self, self.graph.single)

    def exp(self) -> Scalar:
        return elementary.exp(self, self.graph.single)

    def log(self) -> Scalar:
        return elementary.log(self, self.graph.single)

    def atan2(self, y: Scalar, x: Scalar) -> Scalar:
        return elementary.atan2(y, x, self.graph.single)
