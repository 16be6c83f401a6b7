"""A chunk of operations as a function of machine code: each node a vector of as many states as a register has lanes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from articulated.compiler.branches import Branch, branched
from articulated.compiler.graph import MASKS
from articulated.compiler.ir import Format, Text
from articulated.compiler.listing import is_undefined
from articulated.compiler.schedule import Chunk, Schedule

_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_FUSED = {"fma": (False, False), "fms": (False, True), "fnma": (True, False)}
"""Whether the product's sign is turned, and whether that of what is added."""
_COMPARISON = {"lt": "olt", "le": "ole", "eq": "oeq"}
_INTRINSIC = {"abs": "fabs", "sqrt": "sqrt"}
_NOWHERE = -1
"""In place of a node that nobody wants."""


class Places(Protocol):
    """Where in scratch things are that have no slot of their own [bytes]."""

    def address(self, table: int) -> int:
        """The address of a table."""
        ...

    def turn(self, loop: int) -> int:
        """The number of the row that a loop over rows is at."""
        ...

    def place(self, i: int) -> int:
        """A node, constants too."""
        ...


def chunk_function(name: str, chunk: Chunk, schedule: Schedule, f: Format, places: Places, rows: int | None = None) -> str:
    """The function `void name(scratch)` of a chunk; `rows` is where in scratch the rows that it goes through are listed."""
    operations = Operations(schedule, f, name, places, chunk.yields)
    text = operations.text
    if chunk.rows is None:
        _compute(chunk, operations)
    else:
        listed = "" if rows is None else text.at("%scratch", rows)
        with text.loop(text.word(listed) if listed else int(chunk.rows.count)) as turn:  # type: ignore[arg-type]
            row = text.word(listed, text.integer("add", turn.k, 1)) if listed else turn.k
            operations.values = {-1 - chunk.rows.region: row}
            _compute(chunk, operations)
    text = operations.text.function("void", name, "ptr noalias %scratch", linkage="")
    return "\n".join([*operations.tables(), text])


def _compute(chunk: Chunk, operations: Operations) -> None:
    for part in branched(operations.schedule.nodes, operations.schedule.guards, chunk.nodes):
        for i in operations.computed(part):
            if i in chunk.kept:
                operations.replace(i, *chunk.kept[i])
    for entry in chunk.yields:
        if entry not in operations.put:
            operations.put_away(entry)
    _copy(chunk, operations)


def mask_function(name: str, mask: int, holds: bool, schedule: Schedule, f: Format) -> str:
    """The function `i64 name(scratch)` that tells whether a mask holds, or fails, for some state of a block."""
    operations = Operations(schedule, f)
    text = operations.text
    found = text.let(f"fcmp {'une' if holds else 'oeq'} {text.V} {operations.loaded(mask)}, zeroinitializer")
    return text.function("i64", name, "ptr noalias %scratch", text.any(found))


def _copy(chunk: Chunk, operations: Operations) -> None:
    text = operations.text
    overwritten = {target for _, target in chunk.copies}
    early = {source: operations.value(source) for source, _ in chunk.copies if source in overwritten}
    done = None if chunk.unless is None else operations.value(chunk.unless)
    for source, target in chunk.copies:
        operations.values.clear()  # a copy is made from slots: nothing stays in a register for long
        x = early[source] if source in early else operations.value(source)
        if done is not None:
            x = text.let(f"select {text.M} {done}, {text.V} {operations.loaded(target)}, {text.V} {x}")
        operations.store(target, x)


class Operations:
    """Nodes in the order in which they are computed; the others are constants or come from their slots."""

    def __init__(
        self,
        schedule: Schedule,
        f: Format,
        name: str = "",
        places: Places | None = None,
        yields: Sequence[tuple[int, int, int]] = (),
    ):
        self.schedule, self.f, self.text, self.name, self._places = schedule, f, Text(f), name, places
        self.values: dict[int, str] = {}
        self.places_of_rows: list[str] = []
        self.numbers: dict[int, dict[int, int]] = {}
        self.yields, self.put = yields, set[tuple[int, int, int]]()

    @property
    def places(self) -> Places:
        assert self._places is not None
        return self._places

    def computed(self, part: int | Branch) -> Sequence[int]:
        """Compute a node, or what is behind a mask where that holds for some state; the nodes that are known then."""
        if isinstance(part, int):
            self.values[part] = self._operation(*self.schedule.nodes[part])
            self.keep(part)
            return (part,)
        text, nodes, outside = self.text, self.schedule.nodes, self.values
        then, otherwise, end = (text.label() for _ in range(3))
        text.branch(text.some(self.value(part.mask)), then, otherwise)
        text.begin(then)
        self.values = dict(outside)
        for inside in part.parts:
            if isinstance(inside, int) and inside in part.yields:
                self.values[inside] = self._operation("select", *nodes[inside][2:])
            else:
                self.computed(inside)
        given = [self.values[i] for i in part.yields]
        away = [entry for entry in self.yields if entry[0] in part.yields and nodes[entry[0]][0] == "given"]
        for entry in away:
            self.put_away(entry)
        for i in part.yields:
            if i in self.schedule.instead:
                self.store(i, self.values[i])
        then = text.block
        text.go(end)
        text.begin(otherwise)
        self.values = dict(outside)
        for i in part.yields:
            if i not in self.schedule.instead:
                self.values[i] = self.value(nodes[i][-1])
        left = [self.values.get(i, "") for i in part.yields]
        for entry in away:
            if not is_undefined(nodes[nodes[entry[0]][-1]]):
                self.put_away(entry)
        self.put.update(away)
        otherwise = text.block
        text.go(end)
        text.begin(end)
        self.values = outside
        for i, a, b in zip(part.yields, given, left, strict=True):
            if i not in self.schedule.instead:
                outside[i] = text.let(f"phi {text.V} [ {a}, %{then} ], [ {b}, %{otherwise} ]")
        for i in part.yields:
            if i not in self.schedule.instead:
                self.keep(i)
        return part.yields

    def keep(self, i: int) -> None:
        """Put a node into its slot, if it has one."""
        x = self.values[i]
        if i in self.schedule.slots:
            text = self.text
            if self.schedule.nodes[i][0] in MASKS:
                x = text.let(f"select {text.M} {x}, {text.V} {self.f.constant(1.0)}, {text.V} zeroinitializer")
            self.store(i, x)

    def replace(self, i: int, carried: int, unless: int | None) -> None:
        """Put a node's value in the place of a carried one, but for states for which the mask holds."""
        x, text = self.values[i], self.text
        if unless is not None:
            x = text.let(f"select {text.M} {self.value(unless)}, {text.V} {self.loaded(carried)}, {text.V} {x}")
        self.store(carried, x)

    def value(self, i: int) -> str:
        """A node's value, from where it is at hand."""
        if i not in self.values:
            op, *parts = self.schedule.nodes[i]
            if op == "const":
                self.values[i] = self.f.constant(parts[0])
            elif op == "column":
                self.values[i] = self._column(*parts)
            else:
                x = self.loaded(i)
                self.values[i] = self.text.let(f"fcmp une {self.text.V} {x}, zeroinitializer") if op in MASKS else x
        return self.values[i]

    def put_away(self, entry: tuple[int, int, int]) -> None:
        """Put a node where the k-th number of what a loop makes of the present row belongs."""
        i, loop, k = entry
        x = self.value(i)
        rows = range(int(self.schedule.loops[loop - 1].count))  # type: ignore[arg-type]
        there = self._in_row(loop, [self.schedule.made.get((loop, r, k), _NOWHERE) for r in rows])
        self.text.do(f"store {self.text.V} {x}, ptr {there}, align {self.f.vector_bytes}")

    def _column(self, loop: int, k: int) -> str:
        """What column k has in the row that a loop is at."""
        text, f, nodes = self.text, self.f, self.schedule.loops[loop - 1].columns[k]
        if any(self.schedule.nodes[i][0] != "const" for i in nodes):
            return text.load(self._in_row(loop, nodes), text.V, f.vector_bytes)
        columns = self.numbers.setdefault(loop, {})
        n = columns.setdefault(k, len(columns))
        row = f"%{self.name}.row{loop}, ptr @{self.name}.rows{loop}, i64 {self._turn(loop)}"
        return text.spread(text.load(text.let(f"getelementptr {row}, i64 {n}"), f.number, f.bytes))

    def tables(self) -> list[str]:
        """What is to be told before the function."""
        return [*self.places_of_rows, *(self._numbers(loop, list(columns)) for loop, columns in self.numbers.items())]

    def _numbers(self, loop: int, columns: Sequence[int]) -> str:
        """Columns of numbers that are known; those of a row are side by side."""
        one, nodes, kind = replace(self.f, lanes=1), self.schedule.nodes, f"{self.name}.row{loop}"
        numbers = [
            [f"{one.number} {one.constant(nodes[i][1])}" for i in self.schedule.loops[loop - 1].columns[k]] for k in columns
        ]
        rows = [f"%{kind} [{', '.join(row)}]" for row in zip(*numbers, strict=True)]
        table = f"@{self.name}.rows{loop} = internal constant [{len(rows)} x %{kind}] [{', '.join(rows)}]"
        return f"%{kind} = type [{len(columns)} x {one.number}]\n{table}"

    def _turn(self, loop: int) -> str:
        """The number of the row that a loop is at."""
        key = -1 - loop
        if key not in self.values:
            self.values[key] = self.text.word(self.text.at("%scratch", self.places.turn(loop)))
        return self.values[key]

    def _in_row(self, loop: int, nodes: Sequence[int]) -> str:
        """Where that of some nodes is which belongs to the row that a loop is at."""
        text, turn = self.text, self._turn(loop)
        name, size = f"@{self.name}.{len(self.places_of_rows)}", f"[{len(nodes)} x i32]"
        entries = ", ".join(f"i32 {self.places.place(i)}" for i in nodes)
        self.places_of_rows.append(f"{name} = internal constant {size} [{entries}]")
        entry = text.let(f"getelementptr i32, ptr {name}, i64 {turn}")
        return text.at("%scratch", text.let(f"sext i32 {text.load(entry, 'i32', 4)} to i64"))

    def loaded(self, i: int) -> str:
        """What a node's slot holds."""
        return self.text.load(self._slot(i), self.text.V, self.f.vector_bytes)

    def store(self, i: int, x: str) -> None:
        self.text.do(f"store {self.text.V} {x}, ptr {self._slot(i)}, align {self.f.vector_bytes}")

    def _slot(self, i: int) -> str:
        return self.text.at("%scratch", self.schedule.slot(i) * self.f.vector_bytes)

    def _operation(self, op: str, *parts: int) -> str:
        text, V = self.text, self.text.V
        if op == "bit":
            n, a = parts
            one = text.let(f"and {text.N} {self._pattern_of(self.value(a))}, {self.f.integers(1 << n)}")
            return text.let(f"icmp ne {text.N} {one}, {self.f.integers(0)}")
        if op == "lookup":
            return self._looked_up(*parts)
        x = [self.value(a) for a in parts]
        if op in _ARITHMETIC:
            return text.let(f"{_ARITHMETIC[op]} {V} {x[0]}, {x[1]}")
        if op in _FUSED:
            product, rest = _FUSED[op]
            a = text.let(f"fneg {V} {x[0]}") if product else x[0]
            return text.intrinsic("fma", a, x[1], text.let(f"fneg {V} {x[2]}") if rest else x[2])
        if op in _COMPARISON:
            return text.let(f"fcmp {_COMPARISON[op]} {V} {x[0]}, {x[1]}")
        if op in _INTRINSIC:
            return text.intrinsic(_INTRINSIC[op], x[0])
        if op == "same":
            return x[0]
        if op == "neg":
            return text.let(f"fneg {V} {x[0]}")
        if op == "and":
            return text.let(f"and {text.M} {x[0]}, {x[1]}")
        if op == "select":
            return text.let(f"select {text.M} {x[0]}, {V} {x[1]}, {V} {x[2]}")
        return self._on_pattern(op, x[0])

    def _looked_up(self, table: int, index: int) -> str:
        """Each lane's own entry of a table."""
        text, f = self.text, self.f
        base = text.word(text.at("%scratch", self.places.address(table)), 0, "ptr")
        k = text.let(f"fptosi {text.V} {self.value(index)} to {text.N}")
        if f.lanes == 1:
            return text.load(text.let(f"getelementptr {f.number}, ptr {base}, {f.integer} {k}"), f.number, f.bytes)
        x = "poison"
        for lane in range(f.lanes):
            entry = text.let(f"extractelement {text.N} {k}, i32 {lane}")
            number = text.load(text.let(f"getelementptr {f.number}, ptr {base}, {f.integer} {entry}"), f.number, f.bytes)
            x = text.let(f"insertelement {text.V} {x}, {f.number} {number}, i32 {lane}")
        return x

    def _on_pattern(self, op: str, x: str) -> str:
        """power2, exponent and fraction work on the pattern of a number."""
        text, f, N = self.text, self.f, self.text.N
        shift = f.integers(f.pattern.shift)
        pattern = self._pattern_of(x)
        if op == "power2":
            moved = text.let(f"shl {N} {pattern}, {shift}")
            return self._number_of(text.let(f"add {N} {moved}, {f.integers(f.pattern.one)}"))
        k = text.let(f"ashr {N} {text.let(f'sub {N} {pattern}, {f.integers(f.pattern.root)}')}, {shift}")
        if op == "exponent":
            return text.let(f"sitofp {N} {k} to {text.V}")
        return self._number_of(text.let(f"sub {N} {pattern}, {text.let(f'shl {N} {k}, {shift}')}"))

    def _pattern_of(self, x: str) -> str:
        return self.text.let(f"bitcast {self.text.V} {x} to {self.text.N}")

    def _number_of(self, pattern: str) -> str:
        return self.text.let(f"bitcast {self.text.N} {pattern} to {self.text.V}")
