"""Meshes: elements of a few nodes each, which gather what they need of these and scatter what they do to them.

A node is a row of eight numbers, what is done to it a row of four. As many elements as a register has lanes are worked on at
once: the rows of their nodes are loaded whole and transposed in registers, and so is what comes of it, which is added to the
nodes' sums element by element. So sums have one order, and one result, whatever the registers.

A kernel is that of `lowering`; its table is made by `MeshKernel`. It takes steps, each of which goes once through all elements
of each law and then through all nodes, which begins their sums for the next step too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from articulated.compiler.ir import Format
from articulated.compiler.kernels import Kernel, kept
from articulated.compiler.lowering import NOT_FINITE_OUT, module_of
from articulated.compiler.rows import ROW, SUM, TILE, RowWriter, differences, scattered
from articulated.compiler.straight import Straight
from articulated.scalar import Scalar

_LANES = 8
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
        format: of numbers, and how many elements are worked on at once; arrays of elements are that many side by side.
    """

    def __init__(self, mesh: Mesh, single: bool = False):
        from articulated.compiler.machine import machine

        on = machine()
        self.format = f = Format(min(_LANES, on.register // (4 if single else 8)), single)
        passes = _passes(mesh, single)
        counts = repr((mesh.constants, mesh.numbers, [(law.nodes, law.constants) for law in mesh.elements])).encode()
        content = b"\0".join([counts, *(one.content for one in passes)])

        def build() -> tuple[dict[str, Any], bytes]:
            code = on.object_code(_Writer(mesh, passes, f).text())
            room = max([TILE * f.vector_bytes * 3 * law.nodes for law in mesh.elements], default=1)
            return {"operations": 1, "scratch": room, "tile": 1, "objects": [len(code)]}, code

        self._kernel = Kernel(mesh.name, f, on, *kept(mesh.name, f, on, content, build))

    def bound(
        self,
        rows: np.ndarray,
        sums: np.ndarray,
        constants: Sequence[np.ndarray],
        elements: Sequence[tuple[np.ndarray, Sequence[np.ndarray]]],
        numbers: np.ndarray,
    ) -> Callable[[int], int]:
        """What takes so many steps of them; a flag tells of numbers that are not finite.

        Args:
            rows: of nodes, shape (n, 8), n a whole number of lanes, on a line of the cache.
            sums: room for what is done to them, shape (n, 4).
            constants: of nodes, each of shape (n,).
            elements: of each law where the sums of nodes begin, in bytes, of int32, shape (blocks, nodes, lanes), and its
                constants, each of shape (blocks lanes,).
            numbers: the same for all.
        """
        arrays = [rows, sums, *constants, numbers]
        for nodes, given in elements:
            arrays += [nodes, *given]
        counts = [len(rows) // self.format.lanes, *(len(nodes) for nodes, _ in elements)]
        bound = self._kernel.bound(arrays, 1 + len(counts))
        return lambda steps: bound(1, 1, [steps, *counts])


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
            first = law.constants + n
            rows = [x[k : k + ROW] for k in range(first, len(x), ROW)]
            return [c for done in law.act(rows, x[: law.constants], x[law.constants : first]) for c in done]

        passes.append(Straight.of(act, law.nodes * ROW + law.constants + n, single))
    return [*passes, Straight.of(end, ROW + 3 + c + n, single), Straight.of(mesh.go_on, n, single)]


class _Writer(RowWriter):
    """The kernel of a mesh being written."""

    def __init__(self, mesh: Mesh, passes: Sequence[Straight], f: Format):
        super().__init__(f)
        self.mesh, self.passes = mesh, passes

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
        with t.loop(blocks) as block:
            row = self._row(self._nodes(rows, block.k))
            self._put_rows(sums, block.k, self._work(begin, [*row, *self._constants(constants, block.k), *start]))
        with t.loop(steps, t.V, [*start, "zeroinitializer"]) as step:
            numbers = step.values[:-1]
            for (nodes, given), law, one, some in zip(elements, mesh.elements, laws, counts, strict=True):
                act = partial(self._act, law, one, rows, nodes, given, numbers)
                self._in_tiles(some, [], act, partial(self._put_to_sums, law, one, sums, nodes))
            later = self._work(go_on, numbers)
            with t.loop(blocks, t.V, step.values[-1:]) as block:
                here, own = self._nodes(rows, block.k), self._constants(constants, block.k)
                new = self._work(end, [*self._row(here), *self._three(sums, block.k), *own, *numbers])
                self._put_wide(here, new)
                self._put_rows(sums, block.k, self._work(begin, [*new, *own, *later]))
                block.following = [t.marked(block.values[0], new)]
            step.following = [*later, *block.values]
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
        numbers: Sequence[str],
        block: str,
        place: str,
        _: Sequence[str],
    ) -> list[str]:
        """What a block of elements does, put where it waits to be scattered."""
        t, size = self.t, ROW // SUM
        places = [[t.at(rows, t.integer("mul", x, size)) for x in some] for some in self._numbered(law.nodes, nodes, block)]
        first = law.constants + len(numbers)
        rest = dict(zip(one.inputs[:first], [*self._constants(constants, block), *numbers], strict=True))
        if law.nodes == 2 and (apart := differences(one, ROW)) is not None:
            gathered = {apart[k]: x for k, x in enumerate(self._row(places[0], places[1])) if k in apart}
        else:
            gathered = dict(zip(one.inputs[first:], [x for some in places for x in self._row(some)], strict=True))
        done = one.written(t, gathered | rest)
        some = scattered(one, law.nodes)
        self._put_at(self._waiting(place, len(some)), [done[n] for n in some])
        return []

    def _put_to_sums(self, law: Elements, one: Straight, sums: str, nodes: str, block: str, place: str) -> None:
        """Add what a block of elements did to the sums of its nodes."""
        some = scattered(one, law.nodes)
        done = dict(zip(some, self._at(self._waiting(place, len(some)), len(some)), strict=True))
        self._scatter(one, law.nodes, sums, self._numbered(law.nodes, nodes, block), done)
