"""The kernel of implicit steps by conjugate gradients: see `conjugates`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import numpy as np

from articulated.compiler.conjugates import Bonds, Implicit, Passes
from articulated.compiler.ir import Format
from articulated.compiler.kernels import Kernel, kept
from articulated.compiler.lowering import NOT_FINITE_OUT, module_of
from articulated.compiler.rows import ROW, SUM, TILE, RowWriter, differences, opposite, scattered
from articulated.compiler.straight import Parts

_GROUP = 8
"""Nodes, or elements, that are counted together."""
_R, _D, _Z, _B, _OWN = 0, 3, 6, 9, 15
"""Where planes of r, δ, z, B and own blocks begin."""
_END = 1e-28
"""A direction is not followed any more if r · z is this part of what it was."""


class ImplicitKernel:
    """Implicit steps as machine code.

    Attributes:
        format: of numbers, and how many elements are worked on at once.
        kept: numbers that are kept of each element, by law.
    """

    def __init__(self, work: Implicit, single: bool = False):
        from articulated.compiler.machine import machine

        on = machine()
        f = Format(min(_GROUP, on.register // (4 if single else 8)), single)
        passes = Passes.of(work, single)
        self.kept = [bond.kept for bond in passes.bonds]
        self.planes = _OWN + passes.own.planes
        counts = repr((work.constants, work.numbers, [(bond.nodes, bond.constants) for bond in work.bonds], self.kept))
        content = b"\0".join([counts.encode(), *(one.content for one in passes.all())])

        def build() -> tuple[dict[str, Any], bytes]:
            code = on.object_code(_Writer(work, passes, f).text())
            room = TILE * f.vector_bytes * max([9 * bond.nodes for bond in work.bonds], default=1)
            return {"operations": 1, "scratch": room, "tile": 1, "objects": [len(code)]}, code

        self._kernel = Kernel(work.name, f, on, *kept(work.name, f, on, content, build))
        self.format = f

    def bound(
        self,
        rows: np.ndarray,
        room: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
        constants: Sequence[np.ndarray],
        elements: Sequence[tuple[np.ndarray, Sequence[np.ndarray], np.ndarray]],
        numbers: np.ndarray,
    ) -> Callable[[int, int], tuple[float, int]]:
        """What takes so many steps, with so many turns of conjugate gradients in each.

        It tells r · z that the last turns left, of the worst step, and has a flag of numbers that are not finite.

        Args:
            rows: of nodes, shape (n, 8), n a multiple of eight.
            room: planes (planes, n), directions and sums (n, 4), diagonals (n, 8).
            constants: of nodes, each of shape (n,).
            elements: of each law where sums of nodes begin, in bytes, int32, shape (blocks, nodes, lanes); its constants, each
                of shape (blocks lanes,); and room for what is kept, (blocks, kept, lanes).
            numbers: the same for all.
        """
        left = np.zeros(1, self.format.dtype)
        arrays = [rows, *room, *constants, numbers, left]
        for nodes, given, own in elements:
            arrays += [nodes, *given, own]
        groups = [len(rows) // _GROUP, *(len(nodes) * self.format.lanes // _GROUP for nodes, _, _ in elements)]
        bound = self._kernel.bound(arrays, 3 + len(groups))

        def take(steps: int, turns: int) -> tuple[float, int]:
            flags = bound(1, 1, [steps, turns, room[0].strides[0], *groups])
            return float(left[0]), flags

        return take


class _Writer(RowWriter):
    """The kernel being written."""

    def __init__(self, work: Implicit, passes: Passes, f: Format):
        super().__init__(f, _GROUP // f.lanes)
        self.work, self.passes = work, passes
        t, at = self.t, count()

        def pointer() -> str:
            return t.word("%table", 4 * next(at), "ptr")

        self.rows, self.planes, self.p, self.sums, self.diagonals = (pointer() for _ in range(5))
        self.constants = [pointer() for _ in range(work.constants)]
        self.given, self.left = pointer(), pointer()
        self.elements = [(pointer(), [pointer() for _ in range(bond.constants)], pointer()) for bond in work.bonds]
        first = 4 * next(at)
        self.steps, self.turns, self.stride, self.groups, *self.counts = (
            t.word("%table", first + k) for k in range(4 + len(work.bonds))
        )

    def text(self) -> str:
        t, f, n = self.t, self.f, self.work.numbers
        nothing = ["zeroinitializer"]
        start = [t.spread(t.load(t.at(self.given, k * f.bytes), f.number, f.bytes)) for k in range(n)]
        with t.loop(self.steps, t.V, [*start, *nothing, *nothing]) as step:
            *numbers, mark, worst = step.values
            self._begin(numbers)
            for bond, parts, elements, some in zip(self.work.bonds, self.passes.bonds, self.elements, self.counts, strict=True):
                self._set_up(bond, parts, elements, some, numbers)
            square, own = self._settle()
            enough = t.let(f"fmul {t.V} {square}, {f.constant(_END)}")
            with t.loop(self.turns, t.V, [square, own]) as turn:
                turn.following = self._turn(turn.values[0], turn.values[1], enough)
            left = turn.values[0]
            larger = t.let(f"fcmp ogt {t.V} {left}, {worst}")
            worst = t.let(f"select {t.M} {larger}, {t.V} {left}, {t.V} {worst}")
            mark = self._end(numbers, mark)
            step.following = [*self._work(self.passes.go_on, numbers), mark, worst]
        *_, mark, worst = step.values
        lane = t.let(f"extractelement {t.V} {worst}, i32 0")
        t.do(f"store {f.number} {lane}, ptr {self.left}, align {f.bytes}")
        flags = t.flag(mark, NOT_FINITE_OUT)
        kernel = t.function("i64", "kernel", "ptr %table, ptr %scratch, i64 %begin, i64 %end, i64 %tile", flags, linkage="")
        return module_of([kernel], f)

    # nodes

    def _begin(self, numbers: Sequence[str]) -> None:
        """Own parts of b and of the diagonal, in rows; own blocks in planes."""

        def body(block: str, _: Sequence[str]) -> list[str]:
            here = self._nodes(self.rows, block)
            done = self._work(self.passes.begin, [*self._row(here), *self._constants(self.constants, block), *numbers])
            self._put_rows(self.sums, block, done[:3])
            self._put_wide(self._nodes(self.diagonals, block), [*done[3:], *["zeroinitializer"] * 2])
            for k, first in enumerate(self.passes.own.first):
                self._put_planes(_OWN + k, block, [done[3 + first]])
            return []

        self._over_nodes(0, body)

    def _settle(self) -> list[str]:
        """B, and the first z and p; r · z and p · own p."""

        def body(block: str, sums: Sequence[str]) -> list[str]:
            b = self._three(self.sums, block)
            given = [*self._row(self._nodes(self.rows, block)), *b, *self._row(self._nodes(self.diagonals, block))[:6]]
            done = self._work(self.passes.settle, [*given, *self._own(block)])
            B, z = done[:6], done[6:9]
            for first, some in ((_R, b), (_D, ["zeroinitializer"] * 3), (_Z, z), (_B, B)):
                self._put_planes(first, block, some)
            self._put_rows(self.p, block, z)
            self._put_rows(self.sums, block, ["zeroinitializer"] * 3)
            return [self._plus(a, x) for a, x in zip(sums, done[9:], strict=True)]

        return self._over_nodes(2, body)

    def _turn(self, square: str, own: str, enough: str) -> list[str]:
        """A turn of conjugate gradients: r · z and p · own p for the next."""
        t = self.t
        parts = ["zeroinitializer"] * self.parts
        for bond, work, elements, some in zip(self.work.bonds, self.passes.bonds, self.elements, self.counts, strict=True):
            parts = self._products(bond, work, elements, some, parts)
        along = self._plus(self._total(parts), own)
        alpha = self._ratio(square, along, t.let(f"fcmp ogt {t.V} {square}, {enough}"))

        def sweep(block: str, sums: Sequence[str]) -> list[str]:
            given = [*self._planes(_R, 6, block), *self._three(self.p, block), *self._three(self.sums, block)]
            done = self._work(self.passes.sweep, [alpha, *given, *self._planes(_B, 6, block), *self._own(block)])
            self._put_planes(_R, block, done[:9])
            self._put_rows(self.sums, block, ["zeroinitializer"] * 3)
            return [self._plus(sums[0], done[9])]

        (new,) = self._over_nodes(1, sweep)
        beta = self._ratio(new, square, t.let(f"fcmp ogt {t.V} {square}, zeroinitializer"))

        def turned(block: str, sums: Sequence[str]) -> list[str]:
            given = [*self._planes(_Z, 3, block), *self._three(self.p, block), *self._own(block)]
            done = self._work(self.passes.turned, [beta, *given])
            self._put_rows(self.p, block, done[:3])
            return [self._plus(sums[0], done[3])]

        return [new, *self._over_nodes(1, turned)]

    def _end(self, numbers: Sequence[str], mark: str) -> str:
        """New rows; the mark of what is not finite."""
        t = self.t
        with t.loop(t.integer("mul", self.groups, self.parts), t.V, [mark]) as turn:
            here = self._nodes(self.rows, turn.k)
            given = [*self._row(here), *self._planes(_D, 3, turn.k), *self._constants(self.constants, turn.k), *numbers]
            new = self._work(self.passes.end, given)
            self._put_wide(here, new)
            turn.following = [t.marked(turn.values[0], new)]
        return turn.values[0]

    # elements

    def _set_up(self, bond: Bonds, parts: Parts, elements: Any, groups: str, numbers: Sequence[str]) -> None:
        """What elements add to b and to the diagonal; what is kept of them."""
        nodes, given, own = elements
        t, f, one, k = self.t, self.f, parts.now, bond.nodes

        def act(block: str, place: str, _: Sequence[str]) -> list[str]:
            numbered = self._numbered(k, nodes, block)
            rows = [self._row([t.at(self.rows, t.integer("mul", x, ROW // SUM)) for x in some]) for some in numbered]
            done = self._work(one, [*self._constants(given, block), *numbers, *(x for row in rows for x in row)])
            self._put_at(self._waiting(place, 9 * k), done[: 9 * k])
            self._put_at(t.at(own, t.integer("mul", block, parts.kept * f.vector_bytes)), done[9 * k :])
            return []

        def scatter(block: str, place: str) -> None:
            waiting, numbered = self._waiting(place, 9 * k), self._numbered(k, nodes, block)
            parts = []
            for m in range(k):
                b, D = self._at(waiting, 3, 3 * m), self._at(waiting, 6, 3 * k + 6 * m)
                parts.append([self._as_rows(some) for some in (b, D[:SUM], D[SUM:])])
            for lane in range(f.lanes):
                for m, (b, low, high) in enumerate(parts):
                    wide = t.at(self.diagonals, t.integer("mul", numbered[m][lane], ROW // SUM))
                    self._add(t.at(self.sums, numbered[m][lane]), b[lane])
                    self._add(wide, low[lane])
                    self._add(t.at(wide, SUM * f.bytes), high[lane])

        self._in_tiles(groups, [], act, scatter)

    def _products(self, bond: Bonds, parts: Parts, elements: Any, groups: str, sums: list[str]) -> list[str]:
        """What elements add to A p; and to p · A p, in parts."""
        nodes, _, own = elements
        t, one, k = self.t, parts.later, bond.nodes
        apart = differences(one, 3) if k == 2 and opposite(one, 1) else None
        some = scattered(one, k)

        def act(block: str, place: str, sums: Sequence[str]) -> list[str]:
            numbered = self._numbered(k, nodes, block)
            rows = [[self._take(t.at(self.p, x)) for x in of_node] for of_node in numbered]
            known = dict(zip(one.inputs[: parts.kept], self._at(own, parts.kept, block=block), strict=True))
            if apart is not None:
                less = [[self._minus(a, b) for a, b in zip(x, y, strict=True)] for x, y in zip(*rows, strict=True)]
                p = self._columns(less)[:3]
                known |= {apart[n]: p[n] for n in apart}
                done = one.written(t, known)
                along = list(zip(p, done[:3], strict=True))
            else:
                p = [x for of_node in rows for x in self._columns(of_node)[:3]]
                done = one.written(t, known | dict(zip(one.inputs[parts.kept :], p, strict=True)))
                along = list(zip(p, done, strict=True))
            total = sums[0]
            for a, b in along:
                total = self._plus(total, t.let(f"fmul {t.V} {a}, {b}"))
            self._put_at(self._waiting(place, len(some)), [done[n] for n in some])
            return [total]

        def scatter(block: str, place: str) -> None:
            done = dict(zip(some, self._at(self._waiting(place, len(some)), len(some)), strict=True))
            self._scatter(one, k, self.sums, self._numbered(k, nodes, block), done)

        return self._in_tiles(groups, sums, act, scatter)

    # places

    def _over_nodes(self, sums: int, body: Callable[[str, Sequence[str]], list[str]]) -> list[str]:
        """All blocks of nodes; sums over them, in all lanes."""
        t, nothing = self.t, ["zeroinitializer"] * (sums * self.parts)
        with t.loop(self.groups, t.V, nothing) as turn:
            for part in range(self.parts):
                block = t.integer("add", t.integer("mul", turn.k, self.parts), part)
                turn.following += body(block, turn.values[part * sums : (part + 1) * sums])
        return [self._total(turn.values[k::sums]) for k in range(sums)]

    def _total(self, parts: Sequence[str]) -> str:
        """The sum of eight numbers, in all lanes."""
        t, f = self.t, self.f
        numbers = [t.let(f"extractelement {t.V} {x}, i32 {lane}") for x in parts for lane in range(f.lanes)]
        total = numbers[0]
        for x in numbers[1:]:
            total = t.let(f"fadd {f.number} {total}, {x}")
        return t.spread(total)

    def _ratio(self, a: str, b: str, holds: str) -> str:
        """a/b where something holds and b is positive, else 0."""
        t = self.t
        fine = t.let(f"and {t.M} {holds}, {t.let(f'fcmp ogt {t.V} {b}, zeroinitializer')}")
        quotient = t.let(f"fdiv {t.V} {a}, {b}")
        return t.let(f"select {t.M} {fine}, {t.V} {quotient}, {t.V} zeroinitializer")

    def _plus(self, a: str, b: str) -> str:
        return self.t.let(f"fadd {self.t.V} {a}, {b}")

    def _minus(self, a: str, b: str) -> str:
        return self.t.let(f"fsub <{self.part} x {self.f.number}> {a}, {b}")

    def _own(self, block: str) -> list[str]:
        return self._planes(_OWN, self.passes.own.planes, block)

    def _planes(self, first: int, count: int, block: str) -> list[str]:
        """Of so many planes what belongs to a block of nodes."""
        t, f = self.t, self.f
        return [t.load(place, t.V, f.vector_bytes) for place in self._of_planes(first, count, block)]

    def _put_planes(self, first: int, block: str, numbers: Sequence[str]) -> None:
        for place, x in zip(self._of_planes(first, len(numbers), block), numbers, strict=True):
            self.t.do(f"store {self.t.V} {x}, ptr {place}, align {self.f.vector_bytes}")

    def _of_planes(self, first: int, count: int, block: str) -> list[str]:
        t = self.t
        here = t.at(self.planes, t.integer("mul", block, self.f.vector_bytes))
        return [t.at(here, t.integer("mul", self.stride, k)) for k in range(first, first + count)]
