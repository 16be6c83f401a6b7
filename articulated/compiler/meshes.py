"""Meshes: elements of a few nodes each, which gather what they need of these and scatter what they do to them.

A node is a row of eight numbers, what is done to it a row of four. As many elements as a register has lanes are worked on at
once: the rows of their nodes are loaded whole and transposed in registers, and so is what comes of it, which is added to the
nodes' sums element by element. So sums have one order, and one result, whatever the registers.

A kernel is that of `lowering`; its table is made by `MeshKernel`. It takes steps, each of which goes once through all nodes, to
begin their sums; through all elements of each law; and through all nodes again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from articulated.compiler.graph import operands
from articulated.compiler.ir import Format, Text
from articulated.compiler.kernels import Kernel, kept
from articulated.compiler.lowering import NOT_FINITE_OUT, module_of
from articulated.compiler.straight import Straight
from articulated.compiler.transfers import transposed
from articulated.scalar import Scalar

ROW, SUM = 8, 4
"""Numbers of a node, and of what is done to it."""
_LANES = 8
_TILE = 16
"""Blocks of elements whose work is done before any of it is scattered: a processor looks only so far ahead."""
Scalars = Sequence[Scalar]


@dataclass(frozen=True, eq=False)
class Elements:
    """A law for elements of some nodes.

    Attributes:
        nodes: how many nodes an element has.
        constants: how many numbers belong to each element.
        act: from the rows of its nodes, its constants and the numbers of the step to what it does to each node, three numbers.
    """

    nodes: int
    constants: int
    act: Callable[[Sequence[Scalars], Scalars, Scalars], Sequence[Scalars]]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Steps of nodes on which elements act.

    Attributes:
        name: for dumps.
        constants: how many numbers belong to each node besides its row.
        numbers: how many are the same for all, and carried from step to step.
        begin: from a node's row, its constants and the numbers to what is done to it without others, three numbers.
        elements: what acts between nodes.
        end: from a node's row, what was done to it, its constants and the numbers to its new row.
        go_on: from the numbers of a step to those of the next.
    """

    name: str
    constants: int
    numbers: int
    begin: Callable[[Scalars, Scalars, Scalars], Scalars]
    elements: Sequence[Elements]
    end: Callable[[Scalars, Scalars, Scalars, Scalars], Scalars]
    go_on: Callable[[Scalars], Scalars]


class MeshKernel:
    """A mesh as machine code.

    Attributes:
        lanes: elements that are worked on at once; arrays of elements are that many side by side.
    """

    def __init__(self, mesh: Mesh, single: bool = False):
        from articulated.compiler.machine import machine

        on = machine()
        self.lanes = min(_LANES, on.register // (4 if single else 8))
        f = Format(self.lanes, single)
        passes = _passes(mesh, single)
        counts = repr((mesh.constants, mesh.numbers, [(law.nodes, law.constants) for law in mesh.elements])).encode()
        content = b"\0".join([counts, *(one.content for one in passes)])

        def build() -> tuple[dict[str, Any], bytes]:
            code = on.object_code(_Writer(mesh, passes, f).text())
            room = max([_TILE * f.vector_bytes * 3 * law.nodes for law in mesh.elements], default=1)
            return {"operations": 1, "scratch": room, "tile": 1, "objects": [len(code)]}, code

        self._kernel = Kernel(mesh.name, f, on, *kept(mesh.name, f, on, content, build))

    def __call__(
        self,
        rows: np.ndarray,
        sums: np.ndarray,
        constants: Sequence[np.ndarray],
        elements: Sequence[tuple[np.ndarray, Sequence[np.ndarray]]],
        numbers: np.ndarray,
        steps: int,
    ) -> int:
        """Take steps; a flag tells of numbers that are not finite.

        Args:
            rows: of nodes, shape (n, 8), n a whole number of lanes, on a line of the cache.
            sums: room for what is done to them, shape (n, 4).
            constants: of nodes, each of shape (n,).
            elements: of each law where the sums of nodes begin, in bytes, of int32, shape (blocks, nodes, lanes), and its
                constants, each of shape (blocks lanes,).
            numbers: the same for all.
            steps: how many.
        """
        arrays = [rows, sums, *constants, numbers]
        for nodes, given in elements:
            arrays += [nodes, *given]
        counts = [len(rows) // self.lanes, *(len(nodes) for nodes, _ in elements)]
        return self._kernel([(array, 0, 0, None) for array in arrays], 1, 1, [steps, *counts])


def _passes(mesh: Mesh, single: bool) -> list[Straight]:
    """At the beginning, of each law, at the end, and of the numbers."""
    c, n = mesh.constants, mesh.numbers

    def begin(x: Scalars) -> Scalars:
        return mesh.begin(x[:ROW], x[ROW : ROW + c], x[ROW + c :])

    def end(x: Scalars) -> Scalars:
        return mesh.end(x[:ROW], x[ROW : ROW + 3], x[ROW + 3 : ROW + 3 + c], x[ROW + 3 + c :])

    passes = [Straight.of(begin, ROW + c + n, single)]
    for law in mesh.elements:

        def act(x: Scalars, law: Elements = law) -> Scalars:
            rows = [x[k * ROW : (k + 1) * ROW] for k in range(law.nodes)]
            rest = x[law.nodes * ROW :]
            return [c for done in law.act(rows, rest[: law.constants], rest[law.constants :]) for c in done]

        passes.append(Straight.of(act, law.nodes * ROW + law.constants + n, single))
    return [*passes, Straight.of(end, ROW + 3 + c + n, single), Straight.of(mesh.go_on, n, single)]


def _differences(one: Straight) -> dict[int, int] | None:
    """Of a law for two nodes that looks at differences of their rows only: the nodes of these, by their place in the row.

    They are taken before rows are transposed, which is half the work. None: it looks at other things.
    """
    nodes, found = one.nodes, {}
    first, second = one.inputs[:ROW], one.inputs[ROW : 2 * ROW]
    pairs = {("sub", a, b): k for k, (a, b) in enumerate(zip(first, second, strict=True))}
    rows = {*first, *second}
    for i in one.order():
        if nodes[i] in pairs:
            found[pairs[nodes[i]]] = i
        elif not rows.isdisjoint(operands(nodes[i])):
            return None
    return found if rows.isdisjoint(one.outputs) else None


def _opposite(one: Straight, k: int) -> bool:
    """Whether what is done to the k-th node is the opposite of what is done to the first."""
    first, other = one.outputs[:3], one.outputs[3 * k : 3 * k + 3]
    return k > 0 and all(one.nodes[b] == ("neg", a) for a, b in zip(first, other, strict=True))


def _scattered(law: Elements, one: Straight) -> list[int]:
    """Which numbers of what is done are to be scattered: not those that are the opposite of others."""
    return [n for k in range(law.nodes) if not _opposite(one, k) for n in range(3 * k, 3 * k + 3)]


class _Writer:
    """The kernel of a mesh being written."""

    def __init__(self, mesh: Mesh, passes: Sequence[Straight], f: Format):
        self.mesh, self.passes, self.f, self.t = mesh, passes, f, Text(f)
        self.part = min(SUM, f.lanes)

    def text(self) -> str:
        t, mesh = self.t, self.mesh
        begin, *laws, end, go_on = self.passes
        at = count()

        def pointer() -> str:
            return t.word("%table", 4 * next(at), "ptr")

        rows, sums = pointer(), pointer()
        constants = [pointer() for _ in range(mesh.constants)]
        numbers = pointer()
        elements = [(pointer(), [pointer() for _ in range(law.constants)]) for law in mesh.elements]
        first = 4 * next(at)
        steps, blocks, *counts = (t.word("%table", first + k) for k in range(2 + len(mesh.elements)))
        f = self.f
        start = [t.spread(t.load(t.at(numbers, k * f.bytes), f.number, f.bytes)) for k in range(mesh.numbers)]
        with t.loop(steps, t.V, [*start, "zeroinitializer"]) as step:
            numbers = step.values[:-1]
            with t.loop(blocks) as block:
                here = self._nodes(rows, block.k)
                done = self._work(begin, [*self._row(here), *self._constants(constants, block.k), *numbers])
                places = self._nodes(sums, block.k, SUM)
                for place, parts in zip(places, self._as_rows(done), strict=True):
                    self._put(place, parts)
            for (nodes, given), law, one, some in zip(elements, mesh.elements, laws, counts, strict=True):
                tiles = t.integer("sdiv", t.integer("add", some, _TILE - 1), _TILE)
                with t.loop(tiles) as tile:
                    first = t.integer("mul", tile.k, _TILE)
                    here = t.integer("smin", t.integer("sub", some, first), _TILE)
                    with t.loop(here) as turn:
                        block = t.integer("add", first, turn.k)
                        self._act(law, one, rows, nodes, self._constants(given, block), block, turn.k, numbers)
                    with t.loop(here) as turn:
                        self._scatter(law, one, sums, nodes, t.integer("add", first, turn.k), turn.k)
            with t.loop(blocks, t.V, step.values[-1:]) as block:
                here = self._nodes(rows, block.k)
                done = self._columns([self._take(place) for place in self._nodes(sums, block.k, SUM)])[:3]
                new = self._work(end, [*self._row(here), *done, *self._constants(constants, block.k), *numbers])
                for k in range(0, ROW, f.lanes):
                    for place, x in zip(here, transposed(t, new[k : k + f.lanes]), strict=True):
                        t.do(f"store {t.V} {x}, ptr {t.at(place, k * f.bytes)}, align {f.vector_bytes}")
                block.following = [t.marked(block.values[0], new)]
            step.following = [*self._work(go_on, numbers), *block.values]
        flags = t.flag(step.values[-1], NOT_FINITE_OUT)
        kernel = t.function("i64", "kernel", "ptr %table, ptr %scratch, i64 %begin, i64 %end, i64 %tile", flags, linkage="")
        return module_of([kernel], f)

    def _act(
        self,
        law: Elements,
        one: Straight,
        rows: str,
        nodes: str,
        constants: Sequence[str],
        block: str,
        place: str,
        numbers: Sequence[str],
    ) -> None:
        """What a block of elements does, put where it waits to be scattered."""
        t = self.t
        places = [[t.at(rows, t.integer("mul", x, ROW // SUM)) for x in some] for some in self._numbered(law, nodes, block)]
        rest = dict(zip(one.inputs[ROW * law.nodes :], [*constants, *numbers], strict=True))
        if law.nodes == 2 and (differences := _differences(one)) is not None:
            apart = self._row(places[0], places[1])
            gathered = {differences[k]: x for k, x in enumerate(apart) if k in differences}
        else:
            gathered = dict(zip(one.inputs, [x for some in places for x in self._row(some)], strict=False))
        done = one.written(t, gathered | rest)
        for k, x in enumerate(done[n] for n in _scattered(law, one)):
            t.do(f"store {t.V} {x}, ptr {self._waiting(law, one, place, k)}, align {self.f.vector_bytes}")

    def _scatter(self, law: Elements, one: Straight, sums: str, nodes: str, block: str, place: str) -> None:
        """Add what a block of elements does to the sums of its nodes, element by element."""
        t, f, some = self.t, self.f, _scattered(law, one)
        done = {n: t.load(self._waiting(law, one, place, k), t.V, f.vector_bytes) for k, n in enumerate(some)}
        numbered = self._numbered(law, nodes, block)
        first = self._as_rows([done[n] for n in range(3)])
        parts = [
            (first, "fsub") if _opposite(one, k) else (self._as_rows([done[n] for n in range(3 * k, 3 * k + 3)]), "fadd")
            for k in range(law.nodes)
        ]
        for lane in range(f.lanes):
            for k, (of_lanes, operation) in enumerate(parts):
                at = t.at(sums, numbered[k][lane])
                before, kind = self._take(at), f"<{self.part} x {f.number}>"
                self._put(at, [t.let(f"{operation} {kind} {a}, {b}") for a, b in zip(before, of_lanes[lane], strict=True)])

    def _numbered(self, law: Elements, nodes: str, block: str) -> list[list[str]]:
        """Where the sums of a block's nodes begin."""
        t, f = self.t, self.f
        here = t.at(nodes, t.integer("mul", block, 4 * law.nodes * f.lanes))
        found = []
        for k in range(law.nodes):
            some = [t.load(t.at(here, 4 * (k * f.lanes + lane)), "i32", 4) for lane in range(f.lanes)]
            found.append([t.let(f"sext i32 {number} to i64") for number in some])
        return found

    def _waiting(self, law: Elements, one: Straight, place: str, k: int) -> str:
        """Where the k-th number of a block of a tile waits."""
        size = self.f.vector_bytes
        return self.t.at(self.t.at("%scratch", self.t.integer("mul", place, len(_scattered(law, one)) * size)), k * size)

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
        """Three numbers of each lane as the parts of a row of four."""
        t, f = self.t, self.f
        four = [*numbers, "zeroinitializer"]
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
