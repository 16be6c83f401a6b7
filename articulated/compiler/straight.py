"""Work without loops, in the order in which it is done: what kernels of elements are made of, all of it in registers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from articulated.compiler.branches import branched
from articulated.compiler.graph import Graph, Node, Traced
from articulated.compiler.ir import Text
from articulated.compiler.operations import Operations
from articulated.compiler.schedule import Chunk, Schedule, flattened, schedule
from articulated.scalar import Scalar


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
        plan = schedule(graph, [outputs], None, 1, chunk=len(graph.nodes) + 1)
        return Straight(replace(plan, instead={}, slots={}), inputs, outputs)

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
