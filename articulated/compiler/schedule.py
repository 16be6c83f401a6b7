"""From a graph to an order of work: dead code out, multiply-adds fused, the rest in chunks that hand values on through slots.

A chunk becomes one function of machine code, small enough for a compiler whose effort grows faster than its input. What one
chunk computes and another needs has a slot in a scratch buffer; a slot is used again once its value has been used for the last
time. What comes when is for `order` to say.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from articulated.compiler.branches import Branch, Masks, awaited, branched, guards
from articulated.compiler.graph import LEAVES, MASKS, Graph, Loop, Node, operands
from articulated.compiler.order import ordered

CHUNK = 1000
"""Operations in a chunk."""


@dataclass(eq=False)
class Chunk:
    """Nodes computed one after the other; then copies, all at once: from a node to the slot of another.

    A copy into a loop's carried values is not made for states for which the mask node `unless` holds. Some nodes take such a
    value's place at once, on the same terms: `kept` has for each that value's node and the mask, or None. Nodes that a loop
    makes of a row go to the place of that row: node, loop, and the number among what it makes. A chunk that is all of a loop
    over `rows` goes through these itself.
    """

    nodes: list[int] = field(default_factory=list)
    copies: list[tuple[int, int]] = field(default_factory=list)
    unless: int | None = None
    kept: dict[int, tuple[int, int | None]] = field(default_factory=dict)
    yields: list[tuple[int, int, int]] = field(default_factory=list)
    rows: Loop | None = None


@dataclass(eq=False)
class Repeat:
    """A loop over its items, which read these nodes."""

    loop: Loop
    items: list[Item]
    reads: set[int] = field(default_factory=set)


@dataclass(eq=False)
class Exit:
    """Leave the innermost loop if this mask holds for all states of the group."""

    mask: int


@dataclass(eq=False)
class Check:
    """Raise a flag if this mask holds for any state."""

    mask: int


@dataclass(eq=False)
class Transfer:
    """Scalars of an argument into nodes' slots, or of an output from nodes: (scalar, node); a loop's turns count rows."""

    array: int
    scalars: list[tuple[int, int]]
    loop: int


class Read(Transfer):
    """From an argument."""


class Write(Transfer):
    """To an output."""


Item = Chunk | Repeat | Exit | Check | Read | Write


@dataclass(eq=False)
class Schedule:
    """What is left of a graph, in order.

    Attributes:
        nodes: as in the graph, with multiply-adds fused.
        items: the order of work.
        loops: of the graph.
        guards: masks of the nodes behind branches.
        slots: where in scratch a node is kept that is used outside the chunk that computes it.
        size: number of slots.
        made: nodes of what loops make of rows: by loop, row, and number.
        instead: nodes of branches that take the place of what they are where the branch is not taken: its slot too.
    """

    nodes: list[Node]
    items: list[Item]
    loops: list[Loop]
    guards: dict[int, Masks]
    slots: dict[int, int]
    size: int
    made: dict[tuple[int, int, int], int]
    instead: dict[int, int]

    def operations(self) -> Iterator[Node]:
        """All nodes that are computed."""
        return (self.nodes[i] for item in flattened(self.items) if isinstance(item, Chunk) for i in item.nodes)

    def slot(self, index: int) -> int:
        """The slot of a node; what a loop leaves behind is where the loop carried it."""
        return self.slots[resolved(index, self.nodes, self.loops)]


def schedule(
    graph: Graph,
    outputs: Sequence[Sequence[int]],
    check: int | None,
    group: int,
    watched: Iterable[int] = (),
    chunk: int = CHUNK,
) -> Schedule:
    """Order the work that the outputs and the check need.

    Args:
        graph: what was traced.
        outputs: nodes of each result.
        check: mask node of states that should not be computed with, or None.
        group: how many neighbouring scalars of a result are written together.
        watched: arguments to read even if nothing comes of them.
        chunk: operations in a chunk.
    """
    roots = [*outputs, [check] if check is not None else []]
    nodes = _fused(graph, _live(graph.nodes, graph.loops, roots))
    live = _live(nodes, graph.loops, roots)
    behind = guards(graph, nodes, live, [i for row in roots for i in row])
    by_region = ordered(graph, nodes, live, behind)
    written = {loop.region: loop.records for loop in graph.loops}
    written[0] = [(output, k, node) for output, row in enumerate(outputs) for k, node in enumerate(row)]
    items = _Walk(graph, nodes, behind, by_region, written, group, watched, chunk).region(0)
    if check is not None:
        items.append(Check(check))
    instead = _instead(graph, nodes, behind, items)
    slots, size = _slots(nodes, graph.loops, behind, items, live, instead)
    made = {(loop, row, k): i for i in live if nodes[i][0] == "yield" for _, loop, row, k in [nodes[i]]}
    return Schedule(nodes, items, graph.loops, behind, slots, size, made, instead)


def flattened(items: Sequence[Item]) -> Iterator[Item]:
    """Items in order, those of a loop after it."""
    for item in items:
        yield item
        if isinstance(item, Repeat):
            yield from flattened(item.items)


def resolved(i: int, nodes: Sequence[Node], loops: Sequence[Loop]) -> int:
    """The node itself, or for what a loop leaves behind, the node that the loop carries."""
    return loops[nodes[i][1] - 1].carried[nodes[i][2]] if nodes[i][0] == "after" else i


def _live(nodes: Sequence[Node], loops: Sequence[Loop], outputs: Sequence[Sequence[int]]) -> set[int]:
    live: set[int] = set()
    entered: set[int] = set()
    stack = [i for row in outputs for i in row]
    while stack:
        i = stack.pop()
        if i in live:
            continue
        live.add(i)
        node = nodes[i]
        if node[0] in ("carried", "after"):
            loop, k = loops[node[1] - 1], node[2]
            stack += [loop.carried[k], loop.initial[k], loop.following[k]]
            if loop.region not in entered:
                entered.add(loop.region)
                stack += [loop.end, *loop.always()]
        if node[0] == "yield":
            stack += [loops[node[1] - 1].end, loops[node[1] - 1].yields[node[3]]]
        if node[0] == "column":
            stack += loops[node[1] - 1].columns[node[2]]
        stack += operands(node)
    return live


def _fused(graph: Graph, live: set[int]) -> list[Node]:
    """The nodes with sums of products as fma (a b + c), fms (a b - c) and fnma (c - a b).

    What is fused depends on the sum alone, not on what else a program does with the product: so an expression has the same bits
    in all programs. Where a product is used otherwise too it stays, which is no more work than a sum.
    """
    nodes = list(graph.nodes)
    for i in sorted(live):
        if nodes[i][0] not in ("add", "sub") or nodes[i][1] == nodes[i][2]:
            continue
        op, a, b = nodes[i]
        product = next((x for x in (b, a) if nodes[x][0] == "mul"), None)
        if product is None:
            continue
        name = "fma" if op == "add" else "fnma" if product == b else "fms"
        nodes[i] = (name, *nodes[product][1:], a if product == b else b)
    return nodes


class _Walk:
    """Regions into items."""

    def __init__(
        self,
        graph: Graph,
        nodes: list[Node],
        guards: dict[int, Masks],
        by_region: dict[int, list[int]],
        written: dict[int, list[tuple[int, int, int]]],
        group: int,
        watched: Iterable[int],
        chunk: int,
    ):
        self.graph, self.nodes, self.guards = graph, nodes, guards
        self.by_region, self.written = by_region, written
        self.group, self.watched, self.chunk = group, watched, chunk

    def region(self, region: int) -> list[Item]:
        """What is read, what is computed, and what is written as soon as it is known."""
        until = self.graph.loops[region - 1].until if region else None
        place = {i: k for k, i in enumerate(self.by_region[region])}
        items: list[Item] = [*self._reads(region)]
        writes = self._writes(region, place)
        chunk = Chunk()

        def close(done: int) -> None:
            """End the chunk, and write what is known now."""
            nonlocal chunk
            if chunk.nodes:
                items.append(chunk)
                chunk = Chunk()
            ready: dict[int, Write] = {}
            while writes and writes[0][0] <= done:
                _, write = writes.pop(0)
                ready.setdefault(write.array, Write(write.array, [], region)).scalars.extend(write.scalars)
            items.extend(ready.values())

        close(-1)
        for part in branched(self.nodes, self.guards, self.by_region[region]):
            if isinstance(part, Branch):
                some = list(part.nodes())
                if len(chunk.nodes) + len(some) > self.chunk:  # a branch is in one chunk
                    close(place[some[0]] - 1)
                chunk.nodes += some
                continue
            op = self.nodes[part][0]
            if op == "loop":
                close(place[part])
                items += self._loop(self.graph.loops[self.nodes[part][1] - 1])
            if op in LEAVES:
                continue
            chunk.nodes.append(part)
            if part == until or len(chunk.nodes) >= self.chunk:
                close(place[part])
            if part == until:
                items.append(Exit(part))
        close(len(place))
        return items

    def _reads(self, region: int) -> list[Read]:
        arguments: dict[int, list[tuple[int, int]]] = defaultdict(list)
        if region == 0:
            arguments.update((argument, []) for argument in self.watched)
        for i in self.by_region[region]:
            if self.nodes[i][0] in ("input", "row"):
                *_, argument, k = self.nodes[i]
                arguments[argument].append((k, i))
        return [Read(argument, sorted(scalars), region) for argument, scalars in sorted(arguments.items())]

    def _writes(self, region: int, place: dict[int, int]) -> list[tuple[int, Write]]:
        """Groups of neighbouring scalars, each with the place of the last node that it waits for, in that order."""
        groups: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
        for output, k, i in self.written[region]:
            groups[output, k // self.group].append((k, i))

        def last(scalars: list[tuple[int, int]]) -> int:
            waits = (place[i] for _, i in scalars if i in place and self.nodes[i][0] not in LEAVES - {"after", "yield"})
            return max(waits, default=-1)

        writes = [(last(scalars), Write(output, scalars, region)) for (output, _), scalars in groups.items()]
        return sorted(writes, key=lambda entry: entry[0])

    def _loop(self, loop: Loop) -> list[Item]:
        here = set(self.by_region[loop.region])
        carried = [k for k, i in enumerate(loop.carried) if i in here]
        enter = [(loop.initial[k], loop.carried[k]) for k in carried]
        inside = self.region(loop.region)
        moved = [(loop.following[k], loop.carried[k]) for k in carried if loop.following[k] != loop.carried[k]]
        at_once = _at_once(self.nodes, self.graph.loops, inside, moved)
        for chunk in (item for item in inside if isinstance(item, Chunk)):
            chunk.kept = {i: (at_once[i], loop.until) for i in chunk.nodes if i in at_once}
        moved = [copy for copy in moved if copy[0] not in at_once]
        # what is overwritten is copied first
        overwritten = {target for _, target in moved}
        first = [copy for copy in moved if copy[0] in overwritten]
        rest = [copy for copy in moved if copy[0] not in overwritten]
        self._yield(loop, inside)
        body = [*inside, Chunk(copies=first, unless=loop.until), *self._copies(rest, loop.until)]
        body = [item for item in body if not isinstance(item, Chunk) or item.nodes or item.copies or item.yields]
        if loop.columns and len(body) == 1 and isinstance(body[0], Chunk):
            body[0].rows = loop
        reads = {i for item in body for _, i in _reads_of(self.nodes, self.graph.loops, item)}
        return [*self._copies(enter, None), Repeat(loop, body, reads)]

    def _yield(self, loop: Loop, inside: list[Item]) -> None:
        """Let the chunks of a loop over rows put away what it makes of a row, as far as that is wanted."""
        wanted = {self.nodes[i][3] for i in self.by_region[loop.parent] if self.nodes[i][:2] == ("yield", loop.region)}
        left = [(loop.yields[k], loop.region, k) for k in sorted(wanted)]
        for chunk in (item for item in inside if isinstance(item, Chunk)):
            chunk.yields = [entry for entry in left if entry[0] in chunk.nodes]
            left = [entry for entry in left if entry not in chunk.yields]
        if left:
            inside.append(Chunk(yields=left))

    def _copies(self, copies: list[tuple[int, int]], unless: int | None) -> list[Item]:
        return [Chunk(copies=copies[k : k + self.chunk // 4], unless=unless) for k in range(0, len(copies), self.chunk // 4)]


def _at_once(
    nodes: Sequence[Node], loops: Sequence[Loop], inside: Sequence[Item], moved: Sequence[tuple[int, int]]
) -> dict[int, int]:
    """Of the nodes that a loop carries on, those that can take the old value's place as soon as they are computed.

    That is where nothing needs the old value any more, and nothing but the chunk that computes it the new one.
    """
    order: dict[int, tuple[int, int]] = {}
    last: dict[int, tuple[int, int]] = {}
    for n, item in enumerate(inside):
        if isinstance(item, Chunk):
            order.update((i, (n, k)) for k, i in enumerate(item.nodes))
        for k, i in _reads_of(nodes, loops, item):
            last[i] = max(last.get(i, (-1, -1)), (n, k))
    sources = Counter(source for source, _ in moved)
    result = {}
    for source, target in moved:
        alone = sources[source] == 1 and target not in sources
        stays = source in order and last.get(source, order[source])[0] == order[source][0]
        if alone and stays and last.get(target, (-1, -1)) <= order[source] and nodes[source][0] not in MASKS:
            result[source] = target
    return result


def _reads_of(nodes: Sequence[Node], loops: Sequence[Loop], item: Item) -> Iterator[tuple[int, int]]:
    """What an item reads, each with its place in a chunk."""
    if isinstance(item, Chunk):
        for k, i in enumerate(item.nodes):
            yield from ((k, resolved(a, nodes, loops)) for a in operands(nodes[i]))
        yield from ((len(item.nodes), resolved(source, nodes, loops)) for source, _ in item.copies)
        yield from ((len(item.nodes), resolved(i, nodes, loops)) for i, _, _ in item.yields)
    elif isinstance(item, Repeat):
        yield from ((0, resolved(i, nodes, loops)) for column in item.loop.columns for i in column)
        yield from ((0, i) for i in item.reads)
    elif isinstance(item, (Exit, Check)):
        yield 0, item.mask
    elif isinstance(item, Write):
        yield from ((0, resolved(i, nodes, loops)) for _, i in item.scalars)


def _slots(
    nodes: Sequence[Node],
    loops: Sequence[Loop],
    guards: dict[int, Masks],
    items: Sequence[Item],
    live: Iterable[int],
    instead: dict[int, int],
) -> tuple[dict[int, int], int]:
    """A slot for each node that is used outside the chunk that computes it, or the branch."""
    defined: dict[int, int] = {}
    last: dict[int, int] = {}
    position = 0
    taken: dict[int, list[int]] = defaultdict(list)
    made: dict[int, list[int]] = defaultdict(list)
    for i in live:
        if nodes[i][0] == "column":
            taken[nodes[i][1]] += loops[nodes[i][1] - 1].columns[nodes[i][2]]
        elif nodes[i][0] == "yield":
            made[nodes[i][1]].append(i)

    def use(i: int, around: list[tuple[int, int]]) -> None:
        i = resolved(i, nodes, loops)
        if nodes[i][0] in ("const", "column"):
            return
        while i in instead:
            i = instead[i]
        # a loop that runs again needs again what was known before it
        ends = [end for start, end in around if defined[i] < start]
        last[i] = max(last.get(i, -1), ends[0] if ends else position)

    def visit(items: Sequence[Item], around: list[tuple[int, int]]) -> None:
        nonlocal position
        for item in items:
            position += 1
            if isinstance(item, Repeat):
                here = [*around, (position, position + _length(item.items))]
                defined.update((i, position) for i in made[item.loop.region])
                for i in taken[item.loop.region]:
                    use(i, here)
                visit(item.items, here)
            elif isinstance(item, Chunk):
                defined.update((i, position) for i in item.nodes)
                for a in (*_from_slots(nodes, guards, item), *(i for i, _, _ in item.yields if i not in item.nodes)):
                    use(a, around)
                for source, target in item.copies:
                    defined.setdefault(target, position)
                    use(source, around)
                    use(target, around)
                for target, mask in item.kept.values():
                    use(target, around)
                    if mask is not None:
                        use(mask, around)
                if item.unless is not None:
                    use(item.unless, around)
            elif isinstance(item, (Exit, Check)):
                use(item.mask, around)
            else:
                if isinstance(item, Read):
                    defined.update((i, position) for _, i in item.scalars)
                for _, i in item.scalars:
                    use(i, around)

    visit(items, [])
    slots, size = _assigned(defined, last)
    for i, a in instead.items():  # each after the one whose place it takes
        slots[i] = slots[a]
    return slots, size


def _instead(graph: Graph, nodes: Sequence[Node], guards: dict[int, Masks], items: Sequence[Item]) -> dict[int, int]:
    """Nodes of branches that can take the place of what they are otherwise, as nothing needs that any more.

    Where the branch is not taken there is nothing to do then.
    """
    last: dict[int, tuple[int, int]] = {}
    chunks: list[tuple[int, Chunk]] = []
    for n, item in enumerate(flattened(items)):
        if isinstance(item, Chunk):
            chunks.append((n, item))
        if isinstance(item, Repeat):
            last.update((resolved(i, nodes, graph.loops), (n, 0)) for column in item.loop.columns for i in column)
            continue
        for k, i in _reads_of(nodes, graph.loops, item):
            last[i] = max(last.get(i, (-1, -1)), (n, k))
    result: dict[int, int] = {}
    home = {i: n for n, chunk in chunks for i in chunk.nodes}
    for n, chunk in chunks:
        place = {i: k for k, i in enumerate(chunk.nodes)}
        special = {*chunk.kept, *(i for i, _, _ in chunk.yields)}
        taken: set[int] = set()
        for part in branched(nodes, guards, chunk.nodes):
            if not isinstance(part, Branch):
                continue
            end = max(place[i] for i in part.nodes())
            for i in part.yields:
                if nodes[i][0] != "given" or i in special:
                    continue
                b = nodes[i][4]
                fits = nodes[b][0] not in LEAVES | MASKS and graph.region[b] == graph.region[i] and b not in taken
                waits = last.get(i, (-1, -1))[0] > n  # used by another chunk
                if fits and waits and home.get(b, n) < n and last[b] <= (n, end):
                    result[i] = b
                    taken.add(b)
    return result


def _from_slots(nodes: Sequence[Node], guards: dict[int, Masks], chunk: Chunk) -> set[int]:
    """The nodes that a chunk takes from their slots: from outside, or out of another branch."""
    result: set[int] = set()

    def visit(parts: Sequence[int | Branch], at_hand: set[int]) -> None:
        for part in parts:
            if isinstance(part, Branch):
                visit(part.parts, set(at_hand))
                at_hand.update(part.yields)
            else:
                result.update(a for a in awaited(nodes, guards, part) if a not in at_hand)
                at_hand.add(part)

    visit(branched(nodes, guards, chunk.nodes), set())
    return result


def _assigned(defined: dict[int, int], last: dict[int, int]) -> tuple[dict[int, int], int]:
    starts: dict[int, list[int]] = defaultdict(list)
    ends: dict[int, list[int]] = defaultdict(list)
    for i in last:
        starts[defined[i]].append(i)
        ends[last[i]].append(i)
    slots: dict[int, int] = {}
    free: list[int] = []
    size = 0
    for position in sorted({*starts, *ends}):
        for i in starts[position]:
            if free:
                slots[i] = free.pop()
            else:
                slots[i], size = size, size + 1
        free += [slots[i] for i in ends[position]]
    return slots, size


def _length(items: Sequence[Item]) -> int:
    return sum(1 for _ in flattened(items))
