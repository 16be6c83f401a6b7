"""Work that only some states need, and that is skipped where no state of a group does.

A node `given n m a b` is what `select m a b` is. What nothing needs but the `a` of such nodes with one mask is guarded by that
mask: it is computed behind a branch. So is what loops inside take from there for branches of the same mask. The nodes of one
branch, those with the same n, come together. A branch within a branch is none: its nodes select. Bits do not change, as what is
skipped is selected by no state.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby

from articulated.compiler.graph import LEAVES, Graph, Loop, Node, operands

_UNSEEN = -2
_ALWAYS = -1


def guards(graph: Graph, nodes: list[Node], live: Iterable[int], roots: Iterable[int]) -> dict[int, int]:
    """The mask behind which each node is computed, if any; a `given` that is in another's branch becomes a `select`.

    Args:
        graph: regions and loops.
        nodes: its nodes, with multiply-adds fused.
        live: those that are needed.
        roots: those that are needed for themselves: results.
    """

    def is_known(mask: int, region: int) -> bool:
        """Whether it is the same at all times while the region runs: then what is skipped there is skipped in loops inside."""
        while region not in (graph.region[mask], 0):
            region = graph.loops[region - 1].parent
        return region == graph.region[mask]

    needed: dict[int, int] = defaultdict(lambda: _UNSEEN)
    for i in (*roots, *(i for loop in graph.loops for i in _of(loop))):
        needed[i] = _ALWAYS

    def need(i: int, by: int, behind: int) -> None:
        elsewhere = graph.region[i] != graph.region[by]
        if nodes[i][0] in LEAVES or (elsewhere and behind >= 0 and not is_known(behind, graph.region[i])):
            behind = _ALWAYS
        needed[i] = behind if needed[i] in (_UNSEEN, behind) else _ALWAYS

    for i in sorted(live, reverse=True):
        behind = needed[i]
        if nodes[i][0] == "given":
            _, _, mask, a, b = nodes[i]
            if behind == _ALWAYS:
                need(mask, i, _ALWAYS)
                need(a, i, mask)
                need(b, i, _ALWAYS)
                continue
            nodes[i] = ("select", mask, a, b)
        for a in operands(nodes[i]):
            need(a, i, behind)
    return {i: mask for i, mask in needed.items() if mask >= 0}


def runs(nodes: Sequence[Node], guards: Mapping[int, int], order: Iterable[int]) -> Iterator[tuple[int | None, list[int]]]:
    """The nodes in order, cut up into those behind one mask and those behind none."""

    def mask(i: int) -> int | None:
        return nodes[i][2] if nodes[i][0] == "given" else guards.get(i)

    for behind, some in groupby(order, mask):
        yield behind, list(some)


def awaited(nodes: Sequence[Node], guards: Mapping[int, int], i: int) -> Sequence[int]:
    """What must be known before a node is computed: its operands, and the mask that it is behind."""
    return (*operands(nodes[i]), guards[i]) if i in guards else operands(nodes[i])


def _of(loop: Loop) -> Iterator[int]:
    yield from (*loop.initial, *loop.following)
    yield from (node for _, _, node in loop.records)
    if loop.until is not None:
        yield loop.until
