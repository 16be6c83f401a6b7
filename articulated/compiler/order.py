"""The order of work within a region: the algorithm's own, but in what is solved by iteration.

There each node comes just before the first that needs it. Results are taken in their order, each with all that it waits for and
that is not there yet. Iterations are written as one pass after another, over all contacts or all bodies: so the passes over one
limb or contact come together, and fewer values wait in scratch. Where much is computed once (the recursions of dynamics), this
order costs more than it brings. Bits do not change: they depend on what a node is computed from, not on when.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from articulated.compiler.branches import awaited
from articulated.compiler.graph import Graph, Loop, Node


def ordered(graph: Graph, nodes: Sequence[Node], live: Iterable[int], guards: Mapping[int, int]) -> dict[int, list[int]]:
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
            return sorted(entering[parts[0]])
        return [graph.loops[parts[0] - 1].end] if op == "after" else awaited(nodes, guards, i)

    result: dict[int, list[int]] = defaultdict(list)
    late = {loop.region: loop for loop in graph.loops if _iterates(graph, loop)}
    for region, some in members.items():
        first: Sequence[int] = ()
        if region in late:
            loop = late[region]
            first = [*([] if loop.until is None else [loop.until]), *loop.following, *(i for _, _, i in loop.records)]
        result[region] = list(_Order(nodes, some, needs, guards).of([*first, *some]))
    return result


def _iterates(graph: Graph, loop: Loop) -> bool:
    """Whether a loop goes on until something holds, or stands in one that does."""
    return loop.until is not None or (loop.parent > 0 and _iterates(graph, graph.loops[loop.parent - 1]))


class _Order:
    """Of a region: results after each other, each after those that it needs; the nodes of a branch together.

    Attributes:
        waiting: what is not there yet.
        taken: what loops inside take from behind a branch.
        branches: what each yields.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        members: Sequence[int],
        needs: Callable[[int], Iterable[int]],
        guards: Mapping[int, int],
    ):
        self.nodes, self.needs, self.guards = nodes, needs, guards
        self.waiting = set(members)
        loops = (i for i in members if nodes[i][0] == "loop")
        self.taken = {a for i in loops for a in needs(i) if a in guards}
        self.branches: dict[int, list[int]] = defaultdict(list)
        for i in members:
            if self._is_given(i):
                self.branches[nodes[i][1]].append(i)

    def of(self, results: Iterable[int]) -> Iterator[int]:
        """These, and all that is waiting and that they need."""
        for i in _each_after(results, self._enter, self._needs):
            yield from self._behind(self._unit(i)) if self._is_given(i) or i in self.taken else (i,)

    def _is_given(self, i: int) -> bool:
        return self.nodes[i][0] == "given"

    def _unit(self, i: int) -> Sequence[int]:
        """What is computed at once: a node, or those that a branch yields."""
        return self.branches[self.nodes[i][1]] if self._is_given(i) else (i,)

    def _enter(self, i: int) -> bool:
        is_new = i in self.waiting and (i not in self.guards or i in self.taken)
        if is_new:
            self.waiting.difference_update(self._unit(i))
        return is_new

    def _needs(self, i: int) -> Iterable[int]:
        """What must be there before; of a branch what it takes from outside."""
        if self.nodes[i][0] == "loop":
            return self.needs(i)
        stack = list(self._unit(i))
        seen, outside = set(stack), set()
        while stack:
            new = {a for a in self.needs(stack.pop()) if a not in seen}
            seen |= new
            stack += (a for a in new if a in self.guards)
            outside |= {a for a in new if a not in self.guards}
        return outside

    def _behind(self, branch: Sequence[int]) -> Iterator[int]:
        """The nodes of a branch that are not there yet."""
        yields = set(branch)

        def enter(i: int) -> bool:
            is_new = i in yields or (i in self.guards and i in self.waiting)
            yields.discard(i)
            self.waiting.discard(i)
            return is_new

        return _each_after(branch, enter, self.needs)


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
                stack += [(a, False) for a in sorted(needs(i), reverse=True)]


def _entering(
    graph: Graph, nodes: Sequence[Node], members: dict[int, list[int]], guards: Mapping[int, int]
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
        carried = set(members[loop.region])
        for k, i in enumerate(loop.carried):
            if i in carried:
                result[loop.region].add(loop.initial[k])
                used(loop.initial[k], loop.parent)
                used(loop.following[k], loop.region)
        for i in (*(i for _, _, i in loop.records), *([] if loop.until is None else [loop.until])):
            used(i, loop.region)
    return result
