"""Rows of nodes: taken whole from memory and turned in registers, so that a register has one number of each of its lanes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from articulated.compiler.graph import operands
from articulated.compiler.ir import Format, Text
from articulated.compiler.straight import Straight
from articulated.compiler.transfers import transposed

ROW, SUM = 8, 4
"""Numbers of a node, and of what is done to it."""
TILE = 16
"""Blocks of elements whose work is done before any of it is scattered: a processor looks only so far ahead."""


def differences(one: Straight, width: int) -> dict[int, int] | None:
    """Of work of two nodes that looks at differences of their rows only: the nodes of these, by their place in the row.

    They are taken before rows are turned, which is half the work. None: it looks at other things.
    """
    nodes, found = one.nodes, {}
    first, second = one.inputs[-2 * width : -width], one.inputs[-width:]
    pairs = {("sub", a, b): k for k, (a, b) in enumerate(zip(first, second, strict=True))}
    rows = {*first, *second}
    for i in one.order():
        if nodes[i] in pairs:
            found[pairs[nodes[i]]] = i
        elif not rows.isdisjoint(operands(nodes[i])):
            return None
    return found if rows.isdisjoint(one.outputs) else None


def opposite(one: Straight, k: int) -> bool:
    """Whether what is done to the k-th node is the opposite of what is done to the first."""
    first, other = one.outputs[:3], one.outputs[3 * k : 3 * k + 3]
    nodes, pairs = one.nodes, zip(first, other, strict=True)
    return k > 0 and all(nodes[b] == ("neg", a) or nodes[a] == ("neg", b) for a, b in pairs)


def scattered(one: Straight, count: int) -> list[int]:
    """Which numbers of what is done to so many nodes are to be scattered: not those that are the opposite of others."""
    return [n for k in range(count) if not opposite(one, k) for n in range(3 * k, 3 * k + 3)]


class RowWriter:
    """A kernel on rows of nodes being written."""

    def __init__(self, f: Format, parts: int = 1):
        """Of elements that are counted in groups of so many blocks."""
        self.f, self.t, self.part, self.parts = f, Text(f), min(SUM, f.lanes), parts

    def _scatter(self, one: Straight, count: int, sums: str, numbered: Sequence[Sequence[str]], done: dict[int, str]) -> None:
        """Add what a block of elements does to so many nodes to their sums, element by element."""
        first = self._as_rows([done[n] for n in range(3)])
        parts = [
            (first, "fsub") if opposite(one, k) else (self._as_rows([done[n] for n in range(3 * k, 3 * k + 3)]), "fadd")
            for k in range(count)
        ]
        for lane in range(self.f.lanes):
            for k, (of_lanes, operation) in enumerate(parts):
                self._add(self.t.at(sums, numbered[k][lane]), of_lanes[lane], operation)

    def _add(self, place: str, parts: Sequence[str], operation: str = "fadd") -> None:
        """To a row of four, or take off it."""
        kind = f"<{self.part} x {self.f.number}>"
        before = self._take(place)
        self._put(place, [self.t.let(f"{operation} {kind} {a}, {b}") for a, b in zip(before, parts, strict=True)])

    def _in_tiles(
        self,
        groups: str,
        sums: list[str],
        act: Callable[[str, str, Sequence[str]], list[str]],
        scatter: Callable[[str, str], None],
    ) -> list[str]:
        """All blocks of elements, some at a time: first what they do, then where it goes."""
        t, width = self.t, TILE // self.parts
        with t.loop(t.integer("sdiv", t.integer("add", groups, width - 1), width), t.V, sums) as tile:
            first = t.integer("mul", tile.k, width)
            here = t.integer("smin", t.integer("sub", groups, first), width)
            with t.loop(here, t.V, tile.values) as turn:
                for part in range(self.parts):
                    block = t.integer("add", t.integer("mul", t.integer("add", first, turn.k), self.parts), part)
                    place = t.integer("add", t.integer("mul", turn.k, self.parts), part)
                    turn.following += act(block, place, turn.values[part : part + 1])
            start = t.integer("mul", first, self.parts)
            with t.loop(t.integer("mul", here, self.parts)) as other:
                scatter(t.integer("add", start, other.k), other.k)
            tile.following = turn.values
        return tile.values

    def _numbered(self, count: int, nodes: str, block: str) -> list[list[str]]:
        """Where the sums of a block's nodes begin."""
        t, f = self.t, self.f
        here = t.at(nodes, t.integer("mul", block, 4 * count * f.lanes))
        found = []
        for k in range(count):
            some = [t.load(t.at(here, 4 * (k * f.lanes + lane)), "i32", 4) for lane in range(f.lanes)]
            found.append([t.let(f"sext i32 {number} to i64") for number in some])
        return found

    def _work(self, one: Straight, inputs: Sequence[str]) -> list[str]:
        return one.written(self.t, dict(zip(one.inputs, inputs, strict=True)))

    def _nodes(self, base: str, block: str, width: int = ROW) -> list[str]:
        """Where the rows of a block of nodes are."""
        size = width * self.f.bytes
        first = self.t.at(base, self.t.integer("mul", block, size * self.f.lanes))
        return [self.t.at(first, lane * size) for lane in range(self.f.lanes)]

    def _constants(self, planes: Sequence[str], block: str) -> list[str]:
        t, f = self.t, self.f
        return [t.load(t.at(plane, t.integer("mul", block, f.vector_bytes)), t.V, f.vector_bytes) for plane in planes]

    def _row(self, places: Sequence[str], less: Sequence[str] = ()) -> list[str]:
        """The rows of some nodes, less those of others, as a register for each of their numbers."""
        t, f, found = self.t, self.f, []
        for k in range(0, ROW, f.lanes):
            rows, others = (
                [t.load(t.at(place, k * f.bytes), t.V, f.vector_bytes) for place in some] for some in (places, less)
            )
            found += transposed(t, [t.let(f"fsub {t.V} {a}, {b}") for a, b in zip(rows, others, strict=True)] if less else rows)
        return found

    def _as_rows(self, numbers: Sequence[str]) -> list[list[str]]:
        """Up to four numbers of each lane as the parts of a row of four."""
        t, f = self.t, self.f
        four = [*numbers, *["zeroinitializer"] * (SUM - len(numbers))]
        if f.lanes >= SUM:
            square = transposed(t, four)  # of eight lanes: those of the first four, and of the last four beside them
            if f.lanes == SUM:
                return [[x] for x in square]
            return [[t.shuffle(t.V, x, "poison", range(k, k + SUM))] for k in (0, SUM) for x in square]
        halves = [transposed(t, four[k : k + f.lanes]) for k in range(0, SUM, f.lanes)]
        return [list(parts) for parts in zip(*halves, strict=True)]

    def _columns(self, rows: Sequence[Sequence[str]]) -> list[str]:
        """The reverse of `_as_rows`: a register for each of four numbers."""
        t, f = self.t, self.f
        if f.lanes >= SUM:
            wide = [row[0] for row in rows]
            if f.lanes > SUM:
                kind = f"<{SUM} x {f.number}>"
                wide = [t.shuffle(kind, a, b, range(f.lanes)) for a, b in zip(wide[:SUM], wide[SUM:], strict=True)]
            return transposed(t, wide)
        found = []
        for k in range(SUM // f.lanes):
            found += transposed(t, [row[k] for row in rows])
        return found

    def _take(self, place: str) -> list[str]:
        """The parts of a row of four."""
        t, f, kind = self.t, self.f, f"<{self.part} x {self.f.number}>"
        return [t.load(t.at(place, k * f.bytes), kind, self.part * f.bytes) for k in range(0, SUM, self.part)]

    def _put(self, place: str, parts: Sequence[str]) -> None:
        t, f, kind = self.t, self.f, f"<{self.part} x {self.f.number}>"
        for k, x in enumerate(parts):
            t.do(f"store {kind} {x}, ptr {t.at(place, k * self.part * f.bytes)}, align {self.part * f.bytes}")

    def _three(self, base: str, block: str) -> list[str]:
        """Three numbers of a block of nodes, from rows of four."""
        return self._columns([self._take(place) for place in self._nodes(base, block, SUM)])[:3]

    def _put_rows(self, base: str, block: str, numbers: Sequence[str]) -> None:
        """Up to four numbers of a block of nodes, into rows of four."""
        for place, parts in zip(self._nodes(base, block, SUM), self._as_rows(numbers), strict=True):
            self._put(place, parts)

    def _put_wide(self, places: Sequence[str], numbers: Sequence[str]) -> None:
        """All numbers of some rows of nodes."""
        t, f = self.t, self.f
        for k in range(0, ROW, f.lanes):
            for place, x in zip(places, transposed(t, numbers[k : k + f.lanes]), strict=True):
                t.do(f"store {t.V} {x}, ptr {t.at(place, k * f.bytes)}, align {f.vector_bytes}")

    def _waiting(self, place: str, width: int) -> str:
        """Where numbers of a block of a tile wait."""
        return self.t.at("%scratch", self.t.integer("mul", place, width * self.f.vector_bytes))

    def _at(self, place: str, count: int, first: int = 0, block: str | None = None) -> list[str]:
        """Numbers of a block that stand side by side."""
        t, size = self.t, self.f.vector_bytes
        here = place if block is None else t.at(place, t.integer("mul", block, count * size))
        return [t.load(t.at(here, k * size), t.V, size) for k in range(first, first + count)]

    def _put_at(self, place: str, numbers: Sequence[str]) -> None:
        for k, x in enumerate(numbers):
            self.t.do(f"store {self.t.V} {x}, ptr {self.t.at(place, k * self.f.vector_bytes)}, align {self.f.vector_bytes}")
