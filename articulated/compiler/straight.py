"""Work without loops, in the order in which it is done: what kernels of elements are made of, all of it in registers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from articulated.compiler.branches import branched
from articulated.compiler.graph import Graph, Node, Traced, operands
from articulated.compiler.ir import Text
from articulated.compiler.operations import Operations
from articulated.compiler.schedule import Chunk, Schedule, flattened, schedule
from articulated.scalar import Scalar

Scalars = Sequence[Scalar]


@dataclass(frozen=True, eq=False)
class Straight:
    """Some work, as nodes.

    Attributes:
        plan: their order.
        inputs, outputs: those that go in, and that come out.
    """

    plan: Schedule
    inputs: list[int]
    outputs: list[int]

    @staticmethod
    def of(work: Callable[[Sequence[Scalar]], Sequence[Scalar]], count: int, single: bool) -> Straight:
        """What a function of so many scalars does."""
        graph = Graph(single)
        inputs = [graph.node("input", 0, k) for k in range(count)]
        made = work([Traced(graph, i) for i in inputs])
        outputs = [x.index if isinstance(x, Traced) else graph.constant(x) for x in made]
        assert not graph.loops, "it has loops"
        return _straight(graph, inputs, outputs)

    @property
    def content(self) -> bytes:
        """All that decides what it does."""
        return repr((self.plan.nodes, self.plan.guards, self.inputs, self.outputs)).encode()

    @property
    def nodes(self) -> list[Node]:
        """What each node is."""
        return self.plan.nodes

    def order(self) -> list[int]:
        """The nodes that are computed, in order."""
        return [i for item in flattened(self.plan.items) if isinstance(item, Chunk) for i in item.nodes]

    def written(self, text: Text, known: Mapping[int, str]) -> list[str]:
        """Write it, given some nodes: the names of what comes out."""
        operations = _InRegisters(self.plan, text.f)
        operations.text, operations.values = text, dict(known)
        for part in branched(self.plan.nodes, self.plan.guards, self.order()):
            if part not in operations.values:
                operations.computed(part)
        return [operations.value(i) for i in self.outputs]


class _InRegisters(Operations):
    """Nodes that never leave registers."""

    def keep(self, i: int) -> None:
        pass


def parted(work: Callable[[Scalars, Scalars], tuple[Scalars, Scalars]], count: int, later: int, single: bool) -> Parts:
    """What a function of so many scalars, and of so many that are known later, does before and after these are known.

    It returns what is wanted at once, and what depends on the later ones. What the second part needs of the first is kept.
    """
    graph = Graph(single)
    inputs = [graph.node("input", 0, k) for k in range(count)]
    others = [graph.node("input", 1, k) for k in range(later)]
    made = work([Traced(graph, i) for i in inputs], [Traced(graph, i) for i in others])
    first, second = ([x.index if isinstance(x, Traced) else graph.constant(x) for x in some] for some in made)
    assert not graph.loops, "it has loops"
    reached, stack = set[int](), list(second)
    while stack:
        i = stack.pop()
        if i not in reached:
            reached.add(i)
            stack += operands(graph.nodes[i])
    after = set(others)
    for i, node in enumerate(graph.nodes):
        if i in reached and not after.isdisjoint(operands(node)):
            after.add(i)
    wanted = {i for node in after for i in operands(graph.nodes[node])} | set(second)
    kept = sorted(i for i in wanted - after if graph.nodes[i][0] != "const")
    again = Graph(single)
    known = {i: again.node("input", 0, k) for k, i in enumerate(kept)}
    known |= {i: again.node("input", 1, k) for k, i in enumerate(others)}
    for i, node in enumerate(graph.nodes):
        if i in known or i not in reached:
            continue
        if node[0] == "const":
            known[i] = again.constant(node[1])
        elif i in after:
            own = operands(node)
            known[i] = again.node(*node[: len(node) - len(own)], *(known[k] for k in own))
    ends = [known[i] for i in second]
    now = _straight(graph, inputs, [*first, *kept])
    return Parts(now, _straight(again, [known[i] for i in (*kept, *others)], ends), len(kept))


@dataclass(frozen=True, eq=False)
class Parts:
    """Work in two parts.

    Attributes:
        now: what is wanted at once, then what is kept.
        later: from what is kept and what is known later to the rest.
        kept: how many numbers.
    """

    now: Straight
    later: Straight
    kept: int


def _straight(graph: Graph, inputs: list[int], outputs: list[int]) -> Straight:
    plan = schedule(graph, [outputs], None, 1, chunk=len(graph.nodes) + 1)
    return Straight(replace(plan, instead={}, slots={}), inputs, outputs)
