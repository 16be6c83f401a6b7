"""The order of work within a region: the algorithm's own, but in what is solved by iteration.

There each node comes just before the first that needs it. Results are taken in their order, each with all that it waits for and
that is not there yet. Iterations are written as one pass after another, over all contacts or all bodies: so the passes over one
limb or contact come together, and fewer values wait in scratch. Where much is computed once (the recursions of dynamics), this
order costs more than it brings. Bits do not change: they depend on what a node is computed from, not on when.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

from articulated.compiler.graph import Graph, Loop, Node, operands


def ordered(graph: Graph, nodes: Sequence[Node], live: Iterable[int]) -> dict[int, list[int]]:
    """The live nodes of each region in the order in which to compute them.

    Args:
        graph: regions and loops.
        nodes: its nodes, with multiply-adds fused.
        live: those that are needed.
    """
    members: dict[int, list[int]] = defaultdict(list)
    for i in sorted(live):
        members[graph.region[i]].append(i)
    entering = _entering(graph, nodes, members)

    def needs(i: int) -> Iterable[int]:
        op, *parts = nodes[i]
        if op == "loop":
            return sorted(entering[parts[0]])
        return [graph.loops[parts[0] - 1].end] if op == "after" else operands(nodes[i])

    result = defaultdict(list, members)
    for loop in graph.loops:
        if not _iterates(graph, loop):
            continue
        first = [] if loop.until is None else [loop.until]
        results = [*first, *loop.following, *(i for _, _, i in loop.records)]
        result[loop.region] = _late(members[loop.region], results, needs)
    return result


def _iterates(graph: Graph, loop: Loop) -> bool:
    """Whether a loop goes on until something holds, or stands in one that does."""
    return loop.until is not None or (loop.parent > 0 and _iterates(graph, graph.loops[loop.parent - 1]))


def _late(members: Sequence[int], results: Sequence[int], needs: Callable[[int], Iterable[int]]) -> list[int]:
    """The members in order: results after each other, each after those that it needs."""
    waiting, order = set(members), []
    for result in (*results, *members):
        stack = [(result, False)]
        while stack:
            i, is_ready = stack.pop()
            if is_ready:
                order.append(i)
            elif i in waiting:
                waiting.remove(i)
                stack.append((i, True))
                stack += [(a, False) for a in sorted(needs(i), reverse=True)]
    return order


def _entering(graph: Graph, nodes: Sequence[Node], members: dict[int, list[int]]) -> dict[int, set[int]]:
    """What each loop, by its region, takes from outside: to start with, or to look at in its turns."""
    result: dict[int, set[int]] = defaultdict(set)

    def used(i: int, region: int) -> None:
        while region != graph.region[i]:
            result[region].add(i)
            region = graph.loops[region - 1].parent

    for region, some in members.items():
        for i in some:
            for a in operands(nodes[i]):
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
