"""Work that only some states need, and that is skipped where no state of a group does.

A node `given n m a b` is what `select m a b` is. What nothing needs but the `a` of such nodes with one mask is guarded by that
mask: it is computed behind a branch, and within that perhaps behind another. So is what loops inside take from there for
branches of the same masks. The nodes of one branch, those with the same n, come together. Bits do not change: what is skipped
is selected by no state.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from articulated.compiler.graph import LEAVES, Graph, Node, operands

Masks = tuple[int, ...]
"""Those behind which something is, the outermost first."""


def guards(graph: Graph, nodes: list[Node], live: Iterable[int], roots: Iterable[int]) -> dict[int, Masks]:
    """The masks behind which nodes are computed, for those that are behind any; what selects by one of them becomes a `select`.

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

    needed: dict[int, Masks] = {}

    def need(i: int, by: int, behind: Masks) -> None:
        if graph.region[i] != graph.region[by]:
            behind = tuple(mask for mask in behind if is_known(mask, graph.region[i]))
        needed[i] = () if nodes[i][0] in LEAVES else tuple(mask for mask in needed.get(i, behind) if mask in behind)

    for i in (*roots, *(i for loop in graph.loops for i in (*loop.initial, *loop.results()))):
        needed[i] = ()
    for column in columns(graph, nodes, live):
        needed.update(dict.fromkeys(column, ()))
    for i in sorted(live, reverse=True):
        behind = needed.get(i, ())
        if nodes[i][0] == "given":
            _, _, mask, a, b = nodes[i]
            if mask in behind:
                nodes[i] = ("select", mask, a, b)
            need(mask, i, behind)
            need(a, i, behind if mask in behind else (*behind, mask))
            need(b, i, behind)
            continue
        for a in operands(nodes[i]):
            need(a, i, behind)
    return {i: masks for i, masks in needed.items() if masks}


def columns(graph: Graph, nodes: Sequence[Node], some: Iterable[int]) -> Iterator[tuple[int, ...]]:
    """Of those nodes that are columns, the nodes in them."""
    for i in some:
        if nodes[i][0] == "column":
            _, region, k = nodes[i]
            yield graph.loops[region - 1].columns[k]


@dataclass(eq=False)
class Branch:
    """Nodes behind a mask, and branches among them; `yields` are those that others see behind it."""

    mask: int
    parts: list[int | Branch]
    yields: list[int]

    def nodes(self) -> Iterator[int]:
        """All of it, in order."""
        for part in self.parts:
            yield from part.nodes() if isinstance(part, Branch) else (part,)


def branched(nodes: Sequence[Node], guards: Mapping[int, Masks], order: Iterable[int], depth: int = 0) -> list[int | Branch]:
    """The nodes in order, those behind branches in them."""

    def mask(i: int) -> int | None:
        masks = place(nodes, guards, i)
        return masks[depth] if len(masks) > depth else None

    parts: list[int | Branch] = []
    for behind, some in groupby(order, mask):
        if behind is None:
            parts += some
        else:
            inside = list(some)
            yields = [i for i in inside if len(guards.get(i, ())) == depth]
            parts.append(Branch(behind, branched(nodes, guards, inside, depth + 1), yields))
    return parts


def awaited(nodes: Sequence[Node], guards: Mapping[int, Masks], i: int) -> Sequence[int]:
    """What must be known before a node is computed: its operands, and the masks that it is behind."""
    return (*operands(nodes[i]), *guards[i]) if i in guards else operands(nodes[i])


def place(nodes: Sequence[Node], guards: Mapping[int, Masks], i: int) -> Masks:
    """The masks behind which a node stands; a `given` stands behind its own."""
    return (*guards.get(i, ()), nodes[i][2]) if nodes[i][0] == "given" else guards.get(i, ())
