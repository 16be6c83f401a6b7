"""From a schedule to LLVM IR, as text: each scalar a vector of `lanes` states.

A kernel is `i64 kernel(table, scratch, begin, end, tile)`. It handles the states from `begin` to `end` in blocks of `lanes`,
and runs each chunk for `tile` blocks before the next, so that code which outgrows the instruction cache is fetched less
often. A last block that is not full overlaps the one before it; if there is none, missing states repeat the last one. So
nothing is read or written out of bounds, and a state's bits do not depend on where it stands.

The table has four integers for each array, arguments first: address, bytes from state to state, bytes from row to row, and,
for an argument with rows, the address of the numbers of the rows that the turns of its loop take. Then come the parameters.
The scalars of a state are contiguous; they are transposed in registers. The kernel returns flags: 1 if an argument, 2 if a
result is not finite, 4 if a check fails.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from articulated.compiler.graph import MASKS, Parameter
from articulated.compiler.program import Program
from articulated.compiler.schedule import Check, Chunk, Exit, Item, Read, Repeat, Schedule, Write

NOT_FINITE_IN, NOT_FINITE_OUT, CHECK_FAILED = 1, 2, 4

STACK = 256 << 10
"""Bytes of scratch that the function for one state may take from the stack."""
OBJECT = object.__basicsize__
"""Bytes of a Python object before what is its own: in an array data, number of axes, shape, strides, base, type."""

GROUPS = ("full", "rest", "narrow")
"""Groups of as many scalars as lanes, of fewer, and of no more than half: two states share a register there."""
_NOWHERE, _ZERO = -1, -2
"""In place of nodes: where what nobody wants is put, and where zeros are found that nobody wants either."""
_MODULE = 4
"""Chunks in a module."""
_ATTRIBUTES = 'nounwind noinline "stackrealign" "prefer-vector-width"="512" "min-legal-vector-width"="512"'

_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_FUSED = {"fma": (False, False), "fms": (False, True), "fnma": (True, False)}
_COMPARISON = {"lt": "olt", "le": "ole", "eq": "oeq"}


@dataclass(frozen=True)
class Format:
    """A number format and how many of them a register holds."""

    lanes: int
    single: bool

    @property
    def bytes(self) -> int:
        return 4 if self.single else 8

    @property
    def number(self) -> str:
        return "float" if self.single else "double"

    @property
    def integer(self) -> str:
        return "i32" if self.single else "i64"

    def vector(self, of: str) -> str:
        return of if self.lanes == 1 else f"<{self.lanes} x {of}>"

    @property
    def suffix(self) -> str:
        return ("" if self.lanes == 1 else f"v{self.lanes}") + ("f32" if self.single else "f64")

    def constant(self, x: float) -> str:
        bits = f"0x{struct.pack('>d', rounded(x, self.single)).hex()}"
        return bits if self.lanes == 1 else f"splat ({self.number} {bits})"

    def integers(self, n: int) -> str:
        return str(n) if self.lanes == 1 else f"splat ({self.integer} {n})"


def rounded(x: float, single: bool) -> float:
    """A constant as the format holds it."""
    return struct.unpack("f", struct.pack("f", x))[0] if single and abs(x) < 3.4e38 else x


class _Function:
    """The text of one function."""

    def __init__(self, f: Format):
        self.f, self.lines, self.names = f, [], 0
        self.V, self.N = f.vector(f.number), f.vector(f.integer)

    def let(self, text: str) -> str:
        self.names += 1
        self.lines.append(f"  %t{self.names} = {text}")
        return f"%t{self.names}"

    def do(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def at(self, pointer: str, offset: int | str) -> str:
        return self.let(f"getelementptr i8, ptr {pointer}, i64 {offset}") if offset else pointer

    def load(self, pointer: str, kind: str, align: int) -> str:
        return self.let(f"load {kind}, ptr {pointer}, align {align}")

    def call(self, name: str, *operands: str, kind: str | None = None) -> str:
        kind = kind or self.V
        return self.let(f"call {kind} @llvm.{name}.{self.f.suffix}({', '.join(f'{kind} {x}' for x in operands)})")


class Lowering:
    """Makes the functions of one kernel."""

    def __init__(self, schedule: Schedule, program: Program, f: Format):
        self.schedule, self.program, self.f = schedule, program, f
        self.arrays = (*program.arguments, *program.results)
        self.V = f.vector(f.number)
        self.vector_bytes = f.bytes * f.lanes
        self.chunks: list[str] = []
        self.functions: list[str] = []
        self.tables: list[str] = []
        self.extra: dict[int, int] = {}
        self.declared: set[str] = set()

    @property
    def scratch(self) -> int:
        """Bytes of scratch for one block of states."""
        return max(1, self.schedule.size + len(self.extra)) * self.vector_bytes

    # chunks

    def chunk(self, chunk: Chunk) -> str:
        """Write a chunk's function; its name."""
        fn, f = _Function(self.f), self.f
        values: dict[int, str] = {}
        for i in chunk.nodes:
            values[i] = self._operation(fn, i, values)
            if i in self.schedule.slots:
                self._store(fn, i, values[i])
        overwritten = {target for _, target in chunk.copies}
        early = {source: self._value(fn, source, values) for source, _ in chunk.copies if source in overwritten}
        done = None if chunk.unless is None else self._value(fn, chunk.unless, values)
        for source, target in chunk.copies:
            x = early[source] if source in early else self._value(fn, source, {})
            if done is not None:
                x = fn.let(f"select {f.vector('i1')} {done}, {self.V} {self._value(fn, target, {})}, {self.V} {x}")
            fn.do(f"store {self.V} {x}, ptr {self._slot(fn, target)}, align {self.vector_bytes}")
        name = f"@chunk{len(self.chunks)}"
        self.chunks.append("\n".join([f"define void {name}(ptr noalias %scratch) #0 {{", *fn.lines, "  ret void", "}"]))
        return name

    def _slot(self, fn: _Function, i: int) -> str:
        return fn.at("%scratch", self.schedule.slot(i) * self.vector_bytes)

    def _value(self, fn: _Function, i: int, values: dict[int, str]) -> str:
        if i not in values:
            node = self.schedule.nodes[i]
            if node[0] == "const":
                values[i] = self.f.constant(node[1])
            else:
                x = fn.load(self._slot(fn, i), self.V, self.vector_bytes)
                values[i] = fn.let(f"fcmp une {self.V} {x}, zeroinitializer") if node[0] in MASKS else x
        return values[i]

    def _store(self, fn: _Function, i: int, x: str) -> None:
        if self.schedule.nodes[i][0] in MASKS:
            f = self.f
            x = fn.let(f"select {f.vector('i1')} {x}, {self.V} {f.constant(1.0)}, {self.V} zeroinitializer")
        fn.do(f"store {self.V} {x}, ptr {self._slot(fn, i)}, align {self.vector_bytes}")

    def _operation(self, fn: _Function, i: int, values: dict[int, str]) -> str:
        f, V, N = self.f, self.V, fn.N
        op, *parts = self.schedule.nodes[i]
        if op == "bit":
            n, a = parts
            pattern = fn.let(f"bitcast {V} {self._value(fn, a, values)} to {N}")
            one = fn.let(f"and {N} {pattern}, {f.integers(1 << n)}")
            return fn.let(f"icmp ne {N} {one}, zeroinitializer" if f.lanes > 1 else f"icmp ne {N} {one}, 0")
        x = [self._value(fn, a, values) for a in parts]
        if op in _ARITHMETIC:
            return fn.let(f"{_ARITHMETIC[op]} {V} {x[0]}, {x[1]}")
        if op in _FUSED:
            minus_product, minus_sum = _FUSED[op]
            a = fn.let(f"fneg {V} {x[0]}") if minus_product else x[0]
            c = fn.let(f"fneg {V} {x[2]}") if minus_sum else x[2]
            return fn.call("fma", a, x[1], c)
        if op in _COMPARISON:
            return fn.let(f"fcmp {_COMPARISON[op]} {V} {x[0]}, {x[1]}")
        if op == "neg":
            return fn.let(f"fneg {V} {x[0]}")
        if op in ("abs", "sqrt"):
            return fn.call("fabs" if op == "abs" else "sqrt", x[0])
        if op == "and":
            return fn.let(f"and {f.vector('i1')} {x[0]}, {x[1]}")
        if op == "select":
            return fn.let(f"select {f.vector('i1')} {x[0]}, {V} {x[1]}, {V} {x[2]}")
        return self._pattern(fn, op, x[0])

    def _pattern(self, fn: _Function, op: str, x: str) -> str:
        """power2, exponent, fraction: work on the pattern of a number."""
        f, V, N = self.f, self.V, fn.N
        shift, one, root = PATTERN[f.single]
        pattern = fn.let(f"bitcast {V} {x} to {N}")
        if op == "power2":
            moved = fn.let(f"shl {N} {pattern}, {f.integers(shift)}")
            return fn.let(f"bitcast {N} {fn.let(f'add {N} {moved}, {f.integers(one)}')} to {V}")
        k = fn.let(f"ashr {N} {fn.let(f'sub {N} {pattern}, {f.integers(root)}')}, {f.integers(shift)}")
        if op == "exponent":
            return fn.let(f"sitofp {N} {k} to {V}")
        moved = fn.let(f"shl {N} {k}, {f.integers(shift)}")
        return fn.let(f"bitcast {N} {fn.let(f'sub {N} {pattern}, {moved}')} to {V}")

    # arrays

    def transfer(self, item: Read | Write) -> tuple[str, list[int]]:
        """Write down which scalars an item moves: the name of that table, and how many groups in it are of each of `GROUPS`.

        A group is as many neighbouring scalars as there are lanes. The table has for each where it begins [bytes], how many
        scalars there are, and the place of each in scratch [bytes].
        """
        f = self.f
        groups: dict[int, dict[int, int]] = {}
        size = self.arrays[item.array + (len(self.program.arguments) if isinstance(item, Write) else 0)].size
        if self.program.watched and isinstance(item, Read):  # what is not used is looked at too
            groups = {first: {} for first in range(0, size, f.lanes)}
        for k, i in item.scalars:
            groups.setdefault(k - k % f.lanes, {})[k % f.lanes] = i
        rows: list[list[int]] = []
        for first, nodes in groups.items():
            present = min(f.lanes, size - first)
            blank = _NOWHERE if isinstance(item, Read) else _ZERO
            places = [self._place(nodes.get(k, blank)) for k in range(f.lanes)]
            rows.append([first * f.bytes, present, *places])
        kinds = [0 if row[1] == f.lanes else 1 if f.lanes < 4 or row[1] > f.lanes // 2 else 2 for row in rows]
        rows = [row for kind in range(len(GROUPS)) for row, k in sorted(zip(rows, kinds, strict=True)) if k == kind]
        name = f"@groups{len(self.tables)}"
        kind = f"[{2 + f.lanes} x i32]"
        entries = ", ".join(f"{kind} [{', '.join(f'i32 {x}' for x in row)}]" for row in rows)
        self.tables.append(f"{name} = internal constant [{len(rows)} x {kind}] [{entries}]")
        return name, [kinds.count(kind) for kind in range(len(GROUPS))]

    def _place(self, i: int) -> int:
        """Where a node is in scratch; constants are put there, and what nobody wants has a place too."""
        if i >= 0 and self.schedule.nodes[i][0] != "const":
            return self.schedule.slot(i) * self.vector_bytes
        slot = self.extra.setdefault(i, self.schedule.size + len(self.extra))
        return slot * self.vector_bytes

    def constants(self) -> str:
        """Write the function that puts constants into scratch."""
        fn = _Function(self.f)
        for i, slot in self.extra.items():
            if i != _NOWHERE:
                x = self.f.constant(0.0 if i == _ZERO else self.schedule.nodes[i][1])
                fn.do(f"store {self.V} {x}, ptr {fn.at('%scratch', slot * self.vector_bytes)}, align {self.vector_bytes}")
        return self._finish(fn, "void", "ptr noalias %scratch", "ret void")

    def mover(self, reads: bool) -> str:
        """The function that moves groups of scalars from an array to scratch, or back; returns whether one is not finite."""
        fn, f, V = _Function(self.f), self.f, self.V
        row = [fn.load(fn.at("%entry", 8 * k), "i64", 8) for k in range(3)]
        base = fn.at(fn.let(f"inttoptr i64 {row[0]} to ptr"), fn.let(f"mul i64 %base, {row[1]}"))
        base = fn.at(base, fn.let(f"mul i64 %turn, {row[2]}"))
        rows = [fn.at(base, fn.load(fn.at("%lanes", 8 * r), "i64", 8)) for r in range(f.lanes)]
        sums, before = [f.constant(0.0)] * min(4, f.lanes), "start"
        groups = "%groups"
        for part in GROUPS if f.lanes >= 4 else GROUPS[:2]:
            width = f.lanes // 2 if part == "narrow" else f.lanes
            fn.do(f"br label %{part}.head")
            fn.lines.append(f"{part}.head:")
            k, phis = f"%k.{part}", len(fn.lines)
            fn.do(f"br i1 {fn.let(f'icmp slt i64 {k}, %{part}')}, label %{part}.turn, label %{part}.end")
            fn.lines.append(f"{part}.turn:")
            group = fn.at(groups, fn.let(f"mul i64 {k}, {4 * (2 + f.lanes)}"))
            first = fn.let(f"sext i32 {fn.load(group, 'i32', 4)} to i64")
            mask = ""
            if part != "full" and f.lanes > 1:
                present = fn.load(fn.at(group, 4), "i32", 4)
                kind = f"<{width} x i32>"
                spread = fn.let(f"insertelement {kind} poison, i32 {present}, i32 0")
                spread = fn.let(f"shufflevector {kind} {spread}, {kind} poison, {kind} zeroinitializer")
                numbers = ", ".join(f"i32 {n}" for n in range(width))
                mask = fn.let(f"icmp slt {kind} <{numbers}>, {spread}")
            places = [
                fn.at("%scratch", fn.let(f"sext i32 {fn.load(fn.at(group, 8 + 4 * n), 'i32', 4)} to i64")) for n in range(width)
            ]
            ends = [fn.at(pointer, first) for pointer in rows]
            if reads:
                seen = self._row_loads(fn, ends, mask, width)
                for x, place in zip(self._transposed(fn, seen), places, strict=True):
                    fn.do(f"store {V} {x}, ptr {place}, align {self.vector_bytes}")
            else:
                seen = [fn.load(place, V, self.vector_bytes) for place in places]
                self._row_stores(fn, self._transposed(fn, seen), ends, mask, width)
            totals = [f"%sum.{part}{n}" for n in range(len(sums))]
            for n, x in enumerate(seen):  # 0 x is a number if x is one
                totals[n % len(sums)] = fn.call("fma", x, f.constant(0.0), totals[n % len(sums)])
            fn.do(f"{k}.next = add i64 {k}, 1")
            fn.do(f"br label %{part}.head")
            fn.lines.append(f"{part}.end:")
            fn.lines[phis:phis] = [f"  {k} = phi i64 [ 0, %{before} ], [ {k}.next, %{part}.turn ]"] + [
                f"  %sum.{part}{n} = phi {V} [ {x}, %{before} ], [ {total}, %{part}.turn ]"
                for n, (x, total) in enumerate(zip(sums, totals, strict=True))
            ]
            sums, before = [f"%sum.{part}{n}" for n in range(len(sums))], f"{part}.end"
            groups = fn.at(groups, fn.let(f"mul i64 %{part}, {4 * (2 + f.lanes)}"))
        total = sums[0]
        for x in sums[1:]:
            total = fn.let(f"fadd {V} {total}, {x}")
        flag = self._any(fn, fn.let(f"fcmp uno {V} {total}, {total}"))
        arguments = "ptr %entry, ptr %lanes, ptr noalias %scratch, i64 %base, i64 %turn, ptr %groups"
        arguments += "".join(f", i64 %{part}" for part in GROUPS)
        fn.lines.insert(0, "start:")
        return "\n".join(
            [f"define internal i64 @{'read' if reads else 'write'}({arguments}) #0 {{", *fn.lines, f"  ret i64 {flag}", "}"]
        )

    def _any(self, fn: _Function, mask: str) -> str:
        if self.f.lanes == 1:
            return fn.let(f"zext i1 {mask} to i64")
        whole = fn.let(f"bitcast <{self.f.lanes} x i1> {mask} to i{self.f.lanes}")
        return fn.let(f"zext i1 {fn.let(f'icmp ne i{self.f.lanes} {whole}, 0')} to i64")

    def _row_loads(self, fn: _Function, pointers: Sequence[str], mask: str, width: int) -> list[str]:
        """The numbers of each state; if they fill half a register only, of two states each."""
        f = self.f
        half, kind, suffix = width < f.lanes, *self._part(width)
        loaded = []
        for pointer in pointers:
            if not mask:
                loaded.append(fn.load(pointer, kind, f.bytes))
                continue
            self.declared.add(f"declare {kind} @llvm.masked.load.{suffix}.p0(ptr, i32, <{width} x i1>, {kind})")
            given = f"ptr {pointer}, i32 {f.bytes}, <{width} x i1> {mask}, {kind} zeroinitializer"
            loaded.append(fn.let(f"call {kind} @llvm.masked.load.{suffix}.p0({given})"))
        if not half:
            return loaded
        both = self._pick(range(f.lanes))
        return [fn.let(f"shufflevector {kind} {a}, {kind} {b}, {both}") for a, b in zip(loaded, loaded[width:], strict=False)]

    def _row_stores(self, fn: _Function, vectors: Sequence[str], pointers: Sequence[str], mask: str, width: int) -> None:
        """The reverse of `_row_loads`."""
        f, V = self.f, self.V
        kind, suffix = self._part(width)
        if width < f.lanes:
            picks = self._pick(range(width)), self._pick(range(width, f.lanes))
            vectors = [fn.let(f"shufflevector {V} {x}, {V} poison, {pick}") for pick in picks for x in vectors]
        for x, pointer in zip(vectors, pointers, strict=True):
            if not mask:
                fn.do(f"store {kind} {x}, ptr {pointer}, align {f.bytes}")
                continue
            self.declared.add(f"declare void @llvm.masked.store.{suffix}.p0({kind}, ptr, i32, <{width} x i1>)")
            given = f"{kind} {x}, ptr {pointer}, i32 {f.bytes}, <{width} x i1> {mask}"
            fn.do(f"call void @llvm.masked.store.{suffix}.p0({given})")

    def _part(self, width: int) -> tuple[str, str]:
        """Type and suffix of a vector of so many numbers."""
        part = Format(width, self.f.single)
        return part.vector(part.number), part.suffix

    def _pick(self, numbers: Iterable[int]) -> str:
        numbers = list(numbers)
        return f"<{len(numbers)} x i32> <{', '.join(f'i32 {k}' for k in numbers)}>"

    def _transposed(self, fn: _Function, rows: Sequence[str]) -> list[str]:
        """A square of numbers, or two side by side, turned: neighbours exchange halves, at distance 1, 2, 4 …"""
        f, V, rows = self.f, self.V, list(rows)
        distance = 1
        while distance < len(rows):
            for r in range(len(rows)):
                if r & distance:
                    continue
                a, b = rows[r], rows[r + distance]
                low = [k if not k & distance else k - distance + f.lanes for k in range(f.lanes)]
                high = [k + distance if not k & distance else k + f.lanes for k in range(f.lanes)]
                rows[r], rows[r + distance] = (
                    fn.let(f"shufflevector {V} {a}, {V} {b}, {self._pick(pick)}") for pick in (low, high)
                )
            distance *= 2
        return rows

    def any(self, mask: int, holds: bool) -> str:
        """Write the function that tells whether a mask holds, or fails, for some state of the block."""
        fn = _Function(self.f)
        x = fn.load(self._slot(fn, mask), self.V, self.vector_bytes)
        comparison = "une" if holds else "oeq"
        flag = self._any(fn, fn.let(f"fcmp {comparison} {self.V} {x}, zeroinitializer"))
        return self._finish(fn, "i64", "ptr noalias %scratch", f"ret i64 {flag}")

    def _finish(self, fn: _Function, kind: str, arguments: str, end: str) -> str:
        name = f"@part{len(self.functions)}"
        self.functions.append("\n".join([f"define internal {kind} {name}({arguments}) #0 {{", *fn.lines, f"  {end}", "}"]))
        return name

    # functions of the whole

    def light(self) -> str:
        """`light(self, args, nargs)`, a Python function in C for one state: takes numpy arrays, returns whether all went well.

        It looks at the arrays' own headers, and refuses whatever is not a plain array of the expected shape.
        """
        fn = _Function(self.f)

        def demand(condition: str) -> None:
            fn.names += 1
            fn.do(f"br i1 {condition}, label %ok{fn.names}, label %refuse")
            fn.lines.append(f"ok{fn.names}:")

        def word(pointer: str, offset: int | str, kind: str = "i64") -> str:
            return fn.load(fn.at(pointer, offset), kind, 4 if kind == "i32" else 8)

        demand(fn.let(f"icmp eq i64 %nargs, {len(self.arrays)}"))
        kind, numbers = word("@context", 0), word("@context", 8)
        for a, array in enumerate(self.arrays):
            header = word("%args", 8 * a, "ptr")
            demand(fn.let(f"icmp eq i64 {word(header, OBJECT - 8)}, {kind}"))
            demand(fn.let(f"icmp eq i64 {word(header, OBJECT + 40)}, {numbers}"))
            demand(fn.let(f"icmp eq i32 {word(header, OBJECT + 8, 'i32')}, {len(array.shape)}"))
            step = 8 * array.size
            for k, n in enumerate(array.shape):
                step //= max(n, 1)
                for vector, expected in ((OBJECT + 16, n), (OBJECT + 24, step)):
                    demand(fn.let(f"icmp eq i64 {word(word(header, vector, 'ptr'), 8 * k)}, {expected}"))
            data = word(header, OBJECT)
            demand(fn.let(f"icmp eq i64 {fn.let(f'and i64 {data}, 7')}, 0"))
            for k, x in enumerate((data, "0", "0", "0")):
                fn.do(f"store i64 {x}, ptr {fn.at('%table', 32 * a + 8 * k)}")
        flags = fn.let("call i64 @kernel(ptr %table, ptr %scratch, i64 0, i64 1, i64 1)")
        demand(fn.let(f"icmp eq i64 {flags}, 0"))
        last = fn.lines[-1][:-1]
        fn.lines += ["  br label %return", "refuse:", "  br label %return", "return:"]
        place = fn.let(f"phi i64 [ 16, %{last} ], [ 24, %refuse ]")
        answer = word("@context", place, "ptr")
        if sys.version_info < (3, 12):  # later, True and False count no references
            references = word(answer, 0)
            fn.do(f"store i64 {fn.let(f'add i64 {references}, 1')}, ptr {answer}")
        return "\n".join(
            [
                "@context = global [4 x i64] zeroinitializer",
                "define ptr @light(ptr %self, ptr %args, i64 %nargs) #0 {",
                f"  %table = alloca [{4 * len(self.arrays)} x i64]",
                f"  %scratch = alloca [{self.scratch} x i8], align 64",
                *fn.lines,
                f"  ret ptr {answer}",
                "}",
            ]
        )

    def modules(self) -> list[str]:
        """The program: the kernel's own module, then those with the chunks, each small enough to be compiled in a moment."""
        f, driver = self.f, _Driver(self)
        driver.items(self.schedule.items, None)
        driver.first(self.constants())
        light = [self.light()] if f.lanes == 1 and not f.single and self.scratch <= STACK else []
        moves = [self.mover(reads=True), self.mover(reads=False)]
        declared = [f"declare void @chunk{k}(ptr)" for k in range(len(self.chunks))]
        main = [*self.tables, *self.functions, *moves, driver.text(), *light, *declared, *sorted(self.declared)]
        rest = [self.chunks[k : k + _MODULE] for k in range(0, len(self.chunks), _MODULE)]
        common = [
            f"declare {self.V} @llvm.fma.{f.suffix}({self.V}, {self.V}, {self.V})",
            f"declare {self.V} @llvm.sqrt.{f.suffix}({self.V})",
            f"declare {self.V} @llvm.fabs.{f.suffix}({self.V})",
            f"attributes #0 = {{ {_ATTRIBUTES} }}",
            "",
        ]
        return ["\n".join([*module, *common]) for module in (main, *rest)]


PATTERN = (52, 0x3FF0000000000000, 0x3FE6A09E667F3BCD), (23, 0x3F800000, 0x3F3504F3)
"""Bits of the fraction, the pattern of 1, and of √½, for float64 and float32."""


class _Driver:
    """The kernel's own function: loops and calls."""

    def __init__(self, lowering: Lowering):
        self.lowering = lowering
        self.lines: list[str] = []
        self.names = 0
        self.block = "items"

    def let(self, text: str) -> str:
        self.names += 1
        self.lines.append(f"  %d{self.names} = {text}")
        return f"%d{self.names}"

    def label(self) -> str:
        self.names += 1
        return f"L{self.names}"

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")
        self.block = label

    def jump(self, label: str) -> None:
        self.lines.append(f"  br label %{label}")

    def items(self, items: Sequence[Item], end: str | None) -> None:
        """Write what the items do; `end` is where the innermost loop ends."""
        lowering = self.lowering
        for item in items:
            if isinstance(item, Chunk):
                if item.nodes or item.copies:
                    self.every_block(lowering.chunk(item))
            elif isinstance(item, Repeat):
                self.repeat(item)
            elif isinstance(item, (Exit, Check)):
                name = lowering.any(item.mask, holds=isinstance(item, Check))
                some = self.each(lambda scratch, base, name=name: f"call i64 {name}(ptr {scratch})")
                if isinstance(item, Check):
                    self.flag(some, CHECK_FAILED)
                else:
                    proceed = self.label()
                    self.lines.append(f"  br i1 {self.let(f'icmp eq i64 {some}, 0')}, label %{end}, label %{proceed}")
                    self.begin(proceed)
            else:
                self.transfer(item)

    def transfer(self, item: Read | Write) -> None:
        lowering, reads = self.lowering, isinstance(item, Read)
        name, counts = lowering.transfer(item)
        lanes = lowering.f.lanes
        array = item.array + (0 if reads else len(lowering.program.arguments))
        entry = self.let(f"getelementptr i64, ptr %table, i64 {4 * array}")
        offsets = self.let(f"getelementptr i64, ptr %lanes, i64 {array * lanes}")
        turn = self.let(f"load i64, ptr {self.turn(item.loop)}")
        if reads and item.loop:
            turns = self.let(f"load ptr, ptr {self.let(f'getelementptr i64, ptr {entry}, i64 3')}")
            turn = self.let(f"load i64, ptr {self.let(f'getelementptr i64, ptr {turns}, i64 {turn}')}")
        flag = self.each(
            lambda scratch, base: (
                f"call i64 @{'read' if reads else 'write'}(ptr {entry}, ptr {offsets}, ptr {scratch}, "
                f"i64 {base}, i64 {turn}, ptr {name}, {', '.join(f'i64 {count}' for count in counts)})"
            )
        )
        if lowering.program.watched and not item.loop:
            self.flag(flag, NOT_FINITE_IN if reads else NOT_FINITE_OUT)

    def flag(self, some: str, bit: int) -> None:
        flags = self.let("load i64, ptr %flags")
        more = self.let(f"mul i64 {some}, {bit}")
        self.lines.append(f"  store i64 {self.let(f'or i64 {flags}, {more}')}, ptr %flags")

    def turn(self, region: int) -> str:
        return self.let(f"getelementptr i64, ptr %turns, i64 {region}")

    def every_block(self, name: str) -> None:
        """Call a function of scratch alone for each block of the tile."""
        self.each(lambda scratch, base: f"call void {name}(ptr {scratch})")

    def each(self, call) -> str:
        """Call for each block of the tile; whether any call returned 1."""
        label, after, previous = self.label(), self.label(), self.block
        t, some, t_next, some_next = (f"%{name}.{label}" for name in ("t", "some", "more", "sum"))
        self.jump(label)
        self.begin(label)
        self.lines.append(f"  {t} = phi i64 [ 0, %{previous} ], [ {t_next}, %{label} ]")
        self.lines.append(f"  {some} = phi i64 [ 0, %{previous} ], [ {some_next}, %{label} ]")
        scratch = self.let(f"getelementptr i8, ptr %scratch, i64 {self.let(f'mul i64 {t}, %size')}")
        ahead = self.let(f"add i64 %b, {self.let(f'mul i64 {t}, {self.lowering.f.lanes}')}")
        base = self.let(f"call i64 @llvm.smin.i64(i64 {ahead}, i64 %limit)")
        text = call(scratch, base)
        if text.startswith("call void"):
            self.lines += [f"  {text}", f"  {some_next} = add i64 {some}, 0"]
        else:
            self.lines.append(f"  {some_next} = or i64 {some}, {self.let(text)}")
        self.lines.append(f"  {t_next} = add i64 {t}, 1")
        self.lines.append(f"  br i1 {self.let(f'icmp slt i64 {t_next}, %blocks')}, label %{label}, label %{after}")
        self.begin(after)
        return some_next

    def repeat(self, item: Repeat) -> None:
        loop, head, body, end = item.loop, self.label(), self.label(), self.label()
        if isinstance(loop.count, Parameter):
            arrays = len(self.lowering.arrays)
            pointer = self.let(f"getelementptr i64, ptr %table, i64 {4 * arrays + loop.count.index}")
            count = self.let(f"load i64, ptr {pointer}")
        else:
            count = str(loop.count)
        counter = self.let(f"getelementptr i64, ptr %counters, i64 {loop.region}")
        self.lines.append(f"  store i64 0, ptr {counter}")
        self.jump(head)
        self.begin(head)
        k = self.let(f"load i64, ptr {counter}")
        self.lines.append(f"  br i1 {self.let(f'icmp slt i64 {k}, {count}')}, label %{body}, label %{end}")
        self.begin(body)
        self.items(item.items, end)
        for pointer in (counter, self.turn(loop.region)):
            before = self.let(f"load i64, ptr {pointer}")
            self.lines.append(f"  store i64 {self.let(f'add i64 {before}, 1')}, ptr {pointer}")
        self.jump(head)
        self.begin(end)

    def first(self, name: str) -> None:
        """Call a function for each block before anything else."""
        lines, self.lines, block, self.block = self.lines, [], self.block, "items"
        self.every_block(name)
        start = self.lines
        self.lines = [*start, *(line.replace("%items ]", f"%{self.block} ]") for line in lines)]
        self.block = block

    def text(self) -> str:
        """The function, once all items are written."""
        lowering = self.lowering
        lanes, arrays = lowering.f.lanes, len(lowering.arrays)
        loops = 1 + len(lowering.schedule.loops)
        start = [
            "define i64 @kernel(ptr %table, ptr noalias %scratch, i64 %begin, i64 %end, i64 %tile) #0 {",
            "entry:",
            f"  %lanes = alloca [{arrays * lanes} x i64]",
            f"  %turns = alloca [{loops} x i64]",
            f"  %counters = alloca [{loops} x i64]",
            "  %flags = alloca i64",
            "  store i64 0, ptr %flags",
            "  %count = sub i64 %end, %begin",
            "  %final = sub i64 %count, 1",
            f"  %size = add i64 0, {lowering.scratch}",
            f"  %overlap = sub i64 %end, {lanes}",
            "  %limit = call i64 @llvm.smax.i64(i64 %overlap, i64 %begin)",
        ]
        for a in range(arrays):
            start.append(f"  %at{a} = getelementptr i64, ptr %table, i64 {4 * a + 1}")
            start.append(f"  %stride{a} = load i64, ptr %at{a}")
        for r in range(lanes):
            start.append(f"  %lane{r} = call i64 @llvm.smin.i64(i64 {r}, i64 %final)")
            for a in range(arrays):
                start += [
                    f"  %offset{a}.{r} = mul i64 %lane{r}, %stride{a}",
                    f"  %to{a}.{r} = getelementptr i64, ptr %lanes, i64 {a * lanes + r}",
                    f"  store i64 %offset{a}.{r}, ptr %to{a}.{r}",
                ]
        group = [
            "  br label %group",
            "group:",
            "  %b = phi i64 [ %begin, %entry ], [ %b.next, %next ]",
            "  %left = sub i64 %end, %b",
            f"  %rounded = add i64 %left, {lanes - 1}",
            f"  %needed = sdiv i64 %rounded, {lanes}",
            "  %blocks = call i64 @llvm.smin.i64(i64 %needed, i64 %tile)",
            *(f"  %turn{k} = getelementptr i64, ptr %turns, i64 {k}\n  store i64 0, ptr %turn{k}" for k in range(loops)),
            "  br label %items",
            "items:",
        ]
        end = [
            "  br label %next",
            "next:",
            f"  %advance = mul i64 %tile, {lanes}",
            "  %b.next = add i64 %b, %advance",
            "  %again = icmp slt i64 %b.next, %end",
            "  br i1 %again, label %group, label %return",
            "return:",
            "  %result = load i64, ptr %flags",
            "  ret i64 %result",
            "}",
            "declare i64 @llvm.smin.i64(i64, i64)",
            "declare i64 @llvm.smax.i64(i64, i64)",
        ]
        return "\n".join([*start, *group, *self.lines, *end])
