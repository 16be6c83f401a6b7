"""Scans: work that goes along a chain of nodes from its last to its first, and back; chains go side by side in registers.

Inwards each node takes what the one after it hands on, looks at a few nodes before it, hands something on itself, and keeps
something; outwards it takes that up, with what the node before it passes on, and gets its new row. A scan may end at a root, a
node that others move: inwards then gives results there, and outwards is a kernel of its own that starts from what is told.

A kernel is that of `lowering`; its table is made by `ScanKernel`. Numbers of a node stand side by side for as many chains as a
register has lanes: arrays have the shape (blocks, nodes, numbers, lanes).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from articulated.compiler.ir import Format, Text
from articulated.compiler.kernels import Kernel, kept
from articulated.compiler.lowering import NOT_FINITE_OUT, module_of
from articulated.compiler.straight import Straight
from articulated.compiler.streams import on_a_line
from articulated.scalar import Scalar

_SIDE_BY_SIDE = 64
"""Bytes of a number of chains side by side: two registers that are half as long, of which one goes on while the other waits."""

Scalars = Sequence[Scalar]
Pair = tuple[Scalars, Scalars]


@dataclass(frozen=True, eq=False)
class Scan:
    """Work along chains.

    Attributes:
        name: for dumps.
        length: nodes of a chain.
        reach: to how many nodes before it a node looks.
        carried, fixed: numbers of a node that are written back, and besides.
        numbers: of the call, the same for all; they are carried from turn to turn too.
        handed, kept, passed: how many numbers go inwards, stay with a node, and go outwards.
        inward: from the rows of a node and of those before it, as far as there are any, what is handed to it, and the
            numbers to what it hands on and what it keeps. A row is what is carried, then what is fixed.
        outward: from a node's row, what it keeps, what is passed to it, and the numbers to what is carried on and passed on.
        go_on: from the numbers of a turn to those of the next.
        root: if the first node is one, from its row, what is handed to it, and the numbers to results.
        results: how many.
    """

    name: str
    length: int
    reach: int
    carried: int
    fixed: int
    numbers: int
    handed: int
    kept: int
    passed: int
    inward: Callable[[Sequence[Scalars], Scalars, Scalars], Pair]
    outward: Callable[[Scalars, Scalars, Scalars, Scalars], Pair]
    go_on: Callable[[Scalars], Scalars]
    root: Callable[[Scalars, Scalars, Scalars], Scalars] | None = None
    results: int = 0

    @property
    def row(self) -> int:
        """Numbers of a node."""
        return self.carried + self.fixed


@dataclass(frozen=True, eq=False)
class Chained:
    """What a scan works on.

    Attributes:
        carried, fixed: shapes (blocks, nodes, carried, lanes) and (blocks, nodes, fixed, lanes).
        kept: of scans with a root, (blocks, nodes, kept, lanes).
        ends: likewise, room for results, and for what is passed to the first node after the root.
    """

    carried: np.ndarray
    fixed: np.ndarray
    kept: np.ndarray
    ends: np.ndarray

    @staticmethod
    def of(scan: Scan, carried: np.ndarray, fixed: np.ndarray) -> Chained:
        """From what is carried, shape (chains, nodes, carried), and what is fixed, laid out already."""
        blocks, lanes, dtype = len(fixed), fixed.shape[-1], fixed.dtype
        room = on_a_line((blocks, 0 if scan.root is None else scan.length, scan.kept, lanes), dtype)
        ends = on_a_line((blocks, scan.results + scan.passed, lanes), dtype)
        room_for = on_a_line((blocks, scan.length, scan.carried, lanes), dtype)
        chained = Chained(room_for, fixed, room, ends)
        chained.put(carried)
        return chained

    def put(self, carried: np.ndarray) -> None:
        """Have other numbers carried, shape (chains, nodes, carried)."""
        _put(carried, self.carried)

    def nodes(self, chains: int) -> np.ndarray:
        """What is carried, shape (chains, nodes, carried)."""
        blocks, length, size, lanes = self.carried.shape
        return self.carried.transpose(0, 3, 1, 2).reshape(blocks * lanes, length, size)[:chains]


def laid_out(given: np.ndarray, lanes: int, dtype: Any) -> np.ndarray:
    """Numbers of shape (chains, nodes, k) as (blocks, nodes, k, lanes); the last chain again until registers are full."""
    chains, *rest = given.shape
    array = on_a_line((-(-max(chains, 1) // lanes), *rest, lanes), dtype)
    _put(given, array)
    return array


def _put(given: np.ndarray, array: np.ndarray) -> None:
    chains, *rest = given.shape
    blocks, lanes = array.shape[0], array.shape[-1]
    whole = np.zeros((blocks * lanes, *rest), array.dtype)
    whole[:chains], whole[chains:] = given, given[-1:] if chains else 0.0
    array[:] = whole.reshape(blocks, lanes, *rest).transpose(0, 2, 3, 1)


class ScanKernel:
    """A scan as machine code.

    Attributes:
        format: of numbers, and how many chains are side by side.
    """

    def __init__(self, scan: Scan, single: bool = False):
        from articulated.compiler.machine import machine

        on = machine()
        f = Format(_SIDE_BY_SIDE // (4 if single else 8), single)
        self.scan, self.format = scan, f
        work = _Work.of(scan, single)
        parts = ["in", "out"] if scan.root is not None else ["both"]
        self._kernels = {part: self._made(part, work, f, on) for part in parts}

    def _made(self, part: str, work: _Work, f: Format, on: Any) -> Kernel:
        scan = self.scan
        sizes = (
            scan.length,
            scan.reach,
            scan.carried,
            scan.fixed,
            scan.numbers,
            scan.handed,
            scan.kept,
            scan.passed,
            scan.results,
        )
        content = b"\0".join([repr((part, sizes)).encode(), *(one.content for one in work.all())])

        def build() -> tuple[dict[str, Any], bytes]:
            code = on.object_code(_Writer(scan, work, f).text(part))
            operations = scan.length * sum(len(one.order()) for one in (work.inward[-1], work.outward))
            room = max(1, scan.length * scan.kept * f.vector_bytes)
            return {"operations": operations, "scratch": room, "tile": 1, "objects": [len(code)]}, code

        return Kernel(scan.name, f, on, *kept(scan.name, f, on, content, build))

    def laid_out(self, given: np.ndarray) -> np.ndarray:
        """See there."""
        return laid_out(given, self.format.lanes, self.format.dtype)

    def bound(self, chained: Chained, numbers: np.ndarray, part: str = "both") -> Callable[[int, int | None], int]:
        """What takes so many turns of chains, on so many threads; a flag tells of numbers that are not finite.

        Args:
            chained: chains.
            numbers: the same for all.
            part: "both", inwards and outwards; or of scans with a root "in", which leaves results in `chained.ends`, or "out",
                with what is passed on there.
        """
        arrays = [chained.carried, chained.fixed, chained.kept, chained.ends, numbers]
        bound, count = self._kernels[part].bound(arrays, 1), len(chained.carried) * self.format.lanes
        return lambda turns, threads: bound(count, threads, [turns], turns)


@dataclass(frozen=True, eq=False)
class _Work:
    """What happens at nodes, traced.

    Attributes:
        inward: of the first node, which has none before it, of the second, and so on; the last is that of all others.
        outward, go_on, root: as of the scan.
    """

    inward: list[Straight]
    outward: Straight
    go_on: Straight
    root: list[Straight] = field(default_factory=list)

    @staticmethod
    def of(scan: Scan, single: bool) -> _Work:
        row, n, c = scan.row, scan.numbers, scan.carried

        def inward(before: int) -> Straight:
            def work(x: Scalars) -> Scalars:
                rows, rest = [x[k * row : (k + 1) * row] for k in range(before + 1)], x[(before + 1) * row :]
                handed, keeps = scan.inward(rows, rest[: scan.handed], rest[scan.handed :])
                return [*handed, *keeps]

            return Straight.of(work, (before + 1) * row + scan.handed + n, single)

        def outward(x: Scalars) -> Scalars:
            rest = x[row:]
            own, passes = scan.outward(x[:row], rest[: scan.kept], rest[scan.kept : scan.kept + scan.passed], rest[-n:])
            return [*own, *passes]

        def root(x: Scalars) -> Scalars:
            assert scan.root is not None
            return scan.root(x[:row], x[row : row + scan.handed], x[row + scan.handed :])

        ends = [Straight.of(root, row + scan.handed + n, single)] if scan.root is not None else []
        some = [inward(k) for k in range(min(scan.reach, scan.length - 1) + 1)]
        assert len(some[-1].outputs) == scan.handed + scan.kept, f"{scan.name}: {len(some[-1].outputs)} numbers go inwards"
        out = Straight.of(outward, row + scan.kept + scan.passed + n, single)
        assert len(out.outputs) == c + scan.passed, f"{scan.name}: {len(out.outputs)} numbers go outwards"
        return _Work(some, out, Straight.of(scan.go_on, n, single), ends)

    def all(self) -> list[Straight]:
        return [*self.inward, self.outward, self.go_on, *self.root]


class _Writer:
    """The kernel of a scan being written."""

    def __init__(self, scan: Scan, work: _Work, f: Format):
        self.scan, self.work, self.f, self.t = scan, work, f, Text(f)

    def text(self, part: str) -> str:
        t, f, scan = self.t, self.f, self.scan
        at = count()
        carried, fixed, kept, ends, given = (t.word("%table", 4 * next(at), "ptr") for _ in range(5))
        start = [t.spread(t.load(t.at(given, k * f.bytes), f.number, f.bytes)) for k in range(scan.numbers)]
        turns = t.word("%table", 4 * next(at))
        first = t.integer("sdiv", "%begin", f.lanes)
        blocks = t.integer("sdiv", t.integer("sub", "%end", "%begin"), f.lanes)
        with t.loop(blocks, t.V, ["zeroinitializer"]) as block:
            here = t.integer("add", first, block.k)

            def own(base: str, numbers: int, here: str = here) -> str:
                return t.at(base, t.integer("mul", here, numbers * f.vector_bytes))

            rows = own(carried, scan.length * scan.carried), own(fixed, scan.length * scan.fixed)
            if part == "both":
                with t.loop(turns, t.V, [*start, *block.values]) as turn:
                    *numbers, mark = turn.values
                    self._inwards(rows, "%scratch", numbers, 0)
                    mark = self._outwards(rows, "%scratch", numbers, 0, ["zeroinitializer"] * scan.passed, mark)
                    turn.following = [*self._done(self.work.go_on, numbers), mark]
                block.following = turn.values[-1:]
            else:
                keeps, end = own(kept, scan.length * scan.kept), own(ends, scan.results + scan.passed)
                if part == "in":
                    handed = self._inwards(rows, keeps, start, 1)
                    for k, x in enumerate(self._done(self.work.root[0], [*self._row(rows, 0), *handed, *start])):
                        self._store(end, k, x)
                    block.following = block.values
                else:
                    passed = [self._load(end, scan.results + k) for k in range(scan.passed)]
                    block.following = [self._outwards(rows, keeps, start, 1, passed, *block.values)]
        flags = t.flag(block.values[0], NOT_FINITE_OUT)
        kernel = t.function("i64", "kernel", "ptr %table, ptr %scratch, i64 %begin, i64 %end, i64 %tile", flags, linkage="")
        return module_of([kernel], f)

    def _inwards(self, rows: tuple[str, str], keeps: str, numbers: Sequence[str], first: int) -> list[str]:
        """From the last node to the `first`; what it hands on."""
        t, scan = self.t, self.scan
        reach = len(self.work.inward) - 1
        handed = ["zeroinitializer"] * scan.handed
        if scan.length > reach:
            with t.loop(scan.length - max(reach, first), t.V, handed) as loop:
                i = t.integer("sub", scan.length - 1, loop.k)
                loop.following = self._node(rows, keeps, i, reach, loop.values, numbers)
            handed = loop.values
        for i in range(max(reach, first) - 1, first - 1, -1):
            handed = self._node(rows, keeps, i, i, handed, numbers)
        return handed

    def _node(
        self, rows: tuple[str, str], keeps: str, i: int | str, before: int, handed: Sequence[str], numbers: Sequence[str]
    ) -> list[str]:
        """Inwards at node i, which looks at so many before it."""
        t, scan = self.t, self.scan
        some = [x for k in range(before + 1) for x in self._row(rows, t.integer("sub", i, k) if k else i)]
        done = self._done(self.work.inward[before], [*some, *handed, *numbers])
        place = self._at(keeps, i, scan.kept)
        for k, x in enumerate(done[scan.handed :]):
            self._store(place, k, x)
        return done[: scan.handed]

    def _outwards(
        self, rows: tuple[str, str], keeps: str, numbers: Sequence[str], first: int, passed: Sequence[str], mark: str
    ) -> str:
        """From the `first` node to the last; the mark of what is not finite."""
        t, scan = self.t, self.scan
        with t.loop(scan.length - first, t.V, [*passed, mark]) as loop:
            i = t.integer("add", loop.k, first)
            place, own = self._at(keeps, i, scan.kept), self._at(rows[0], i, scan.carried)
            kept = [self._load(place, k) for k in range(scan.kept)]
            done = self._done(self.work.outward, [*self._row(rows, i), *kept, *loop.values[:-1], *numbers])
            for k, x in enumerate(done[: scan.carried]):
                self._store(own, k, x)
            loop.following = [*done[scan.carried :], t.marked(loop.values[-1], done[: scan.carried])]
        return loop.values[-1]

    def _row(self, rows: tuple[str, str], i: int | str) -> list[str]:
        """All numbers of node i."""
        found = []
        for base, size in zip(rows, (self.scan.carried, self.scan.fixed), strict=True):
            place = self._at(base, i, size)
            found += [self._load(place, k) for k in range(size)]
        return found

    def _at(self, base: str, i: int | str, size: int) -> str:
        return self.t.at(base, self.t.integer("mul", i, size * self.f.vector_bytes))

    def _load(self, place: str, k: int) -> str:
        return self.t.load(self.t.at(place, k * self.f.vector_bytes), self.t.V, self.f.vector_bytes)

    def _store(self, place: str, k: int, x: str) -> None:
        self.t.do(f"store {self.t.V} {x}, ptr {self.t.at(place, k * self.f.vector_bytes)}, align {self.f.vector_bytes}")

    def _done(self, one: Straight, inputs: Sequence[str]) -> list[str]:
        return one.written(self.t, dict(zip(one.inputs, inputs, strict=True)))
