"""The order of work within a region: the algorithm's own, but in what is solved by iteration.

There each node comes just before the first that needs it. Results are taken in their order, each with all that it waits for and
that is not there yet. Iterations are written as one pass after another, over all contacts or all bodies: so the passes over one
limb or contact come together, and fewer values wait in scratch. Where much is computed once (the recursions of dynamics), this
order costs more than it brings; and passages that are written in an order of their own keep it. Bits do not change: they depend
on what a node is computed from, not on when.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from articulated.compiler.branches import Masks, awaited, columns, place
from articulated.compiler.graph import Graph, Loop, Node


def ordered(graph: Graph, nodes: Sequence[Node], live: Iterable[int], guards: Mapping[int, Masks]) -> dict[int, list[int]]:
    """The live nodes of each region in the order in which to compute them.

    Args:
        graph: regions and loops.
        nodes: its nodes, with multiply-adds fused.
        live: those that are needed.
        guards: masks of those behind branches.
    """
    members: dict[int, list[int]] = defaultdict(list)
    for i in sorted(live):
        members[graph.region[i]].append(i)
    entering = _entering(graph, nodes, members, guards)

    def needs(i: int) -> Iterable[int]:
        op, *parts = nodes[i]
        if op == "loop":
            return entering[parts[0]]
        return [graph.loops[parts[0] - 1].end] if op in ("after", "yield") else awaited(nodes, guards, i)

    result: dict[int, list[int]] = defaultdict(list)
    late = {loop.region: loop for loop in graph.loops if _iterates(graph, loop)}
    for region, some in members.items():
        first = late[region].results() if region in late else ()
        order = _Order(nodes, some, needs, guards, graph.written)
        result[region] = list(order.of(i for i in (*first, *some) if i not in guards))
    return result


def _iterates(graph: Graph, loop: Loop) -> bool:
    """Whether a loop goes on until something holds, or stands in one that does."""
    return loop.until is not None or (loop.parent > 0 and _iterates(graph, graph.loops[loop.parent - 1]))


class _Order:
    """Of a region: results after each other, each after those that it needs; the nodes of a branch together.

    Attributes:
        waiting: what is not there yet.
        branches: what each yields, by its number and the masks behind which that is needed.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        members: Sequence[int],
        needs: Callable[[int], Iterable[int]],
        guards: Mapping[int, Masks],
        written: Mapping[int, int],
    ):
        self.nodes, self.needs, self.guards = nodes, needs, guards
        self.waiting = set(members)
        self.passages: dict[int, list[int]] = defaultdict(list)
        self.written = {i: written[i] for i in members if i in written and i not in guards}
        for i, passage in self.written.items():
            self.passages[passage].append(i)
        self.branches: dict[tuple[int, Masks], list[int]] = defaultdict(list)
        for i in members:
            if nodes[i][0] == "given":
                self.branches[self._branch(i)].append(i)

    def of(self, results: Iterable[int]) -> Iterator[int]:
        """These, and all that is waiting and that they need."""
        for i in _each_after(results, self._enter, self._outside):
            if self.nodes[i][0] == "given":
                branch = self._unit(i)
                yield from self.of(self.nodes[k][3] for k in branch)
                yield from branch
            else:
                yield from self._unit(i)

    def _unit(self, i: int) -> Sequence[int]:
        """What is computed at once: a node, those that a branch yields, or a passage."""
        if i in self.written:
            return self.passages[self.written[i]]
        return self.branches[self._branch(i)] if self.nodes[i][0] == "given" else (i,)

    def _branch(self, i: int) -> tuple[int, Masks]:
        return self.nodes[i][1], self.guards.get(i, ())

    def _enter(self, i: int) -> bool:
        is_new = i in self.waiting
        if is_new:
            self.waiting.difference_update(self._unit(i))
        return is_new

    def _outside(self, i: int) -> Iterable[int]:
        """What must be there before a node, the last first; before a branch, what it takes from outside.

        What loops take from behind branches comes last: by then most of it is there, behind fewer branches.
        """
        if i in self.written:
            inside = set(self._unit(i))
            return sorted({a for k in inside for a in self.needs(k)} - inside, reverse=True)
        if self.nodes[i][0] != "given":
            return sorted(self.needs(i), key=lambda a: (self.guards.get(a, ()), a), reverse=True)
        behind, stack = place(self.nodes, self.guards, i), list(self._unit(i))
        seen, outside = set(stack), set()
        while stack:
            new = {a for a in self.needs(stack.pop()) if a not in seen}
            seen |= new
            inside = {a for a in new if self.guards.get(a, ())[: len(behind)] == behind}
            stack += inside
            outside |= new - inside
        return sorted(outside, reverse=True)


def _each_after(results: Iterable[int], enter: Callable[[int], bool], needs: Callable[[int], Iterable[int]]) -> Iterator[int]:
    """The results, each after those that it needs; of what is not to `enter`, nothing."""
    for result in results:
        stack = [(result, False)]
        while stack:
            i, is_ready = stack.pop()
            if is_ready:
                yield i
            elif enter(i):
                stack.append((i, True))
                stack += [(a, False) for a in needs(i)]


def _entering(
    graph: Graph, nodes: Sequence[Node], members: dict[int, list[int]], guards: Mapping[int, Masks]
) -> dict[int, set[int]]:
    """What each loop, by its region, takes from outside: to start with, or to look at in its turns."""
    result: dict[int, set[int]] = defaultdict(set)

    def used(i: int, region: int) -> None:
        while region != graph.region[i]:
            result[region].add(i)
            region = graph.loops[region - 1].parent

    for region, some in members.items():
        for i in some:
            for a in awaited(nodes, guards, i):
                used(a, region)
    for loop in graph.loops:
        for column in columns(graph, nodes, members[loop.region]):
            result[loop.region].update(column)
            for i in column:
                used(i, loop.parent)
        carried = set(members[loop.region])
        for k, i in enumerate(loop.carried):
            if i in carried:
                result[loop.region].add(loop.initial[k])
                used(loop.initial[k], loop.parent)
                used(loop.following[k], loop.region)
        for i in (*(i for _, _, i in loop.records), *([] if loop.until is None else [loop.until])):
            used(i, loop.region)
    return result
