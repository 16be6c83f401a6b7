"""Arrays to scratch and back. A state's scalars are neighbours in an array; in scratch, those of a block's states are.

So squares of numbers are transposed in registers: a group is as many neighbouring scalars as a register has lanes, of as many
states. Which groups an item of the schedule moves is in a table, which has for each group where it begins in the state [bytes],
how many scalars there are, and the place of each in scratch [bytes]. One function reads all such tables, another writes.

Some tables have groups that are not full; where these hold half as many scalars or fewer, two states share a register.
"""

from __future__ import annotations

from collections.abc import Sequence

from articulated.compiler.ir import Format, Text
from articulated.compiler.listing import Listing
from articulated.compiler.program import Program
from articulated.compiler.schedule import Read, Schedule, Write

_NOWHERE, _ZERO, _TABLES, _TURNS = -1, -2, -10, -1_000_000
"""In place of nodes: where what nobody wants is put, and where zeros are found that nobody wants either.

From there on down, where the addresses of tables are, and the numbers of rows.
"""


class Transfers:
    """The reads and writes of one kernel.

    Attributes:
        kinds: of groups, in the order of their tables: scalars that a register takes of each state, and whether all are there.
    """

    def __init__(self, schedule: Schedule, program: Program, f: Format):
        self.schedule, self.program, self.f = schedule, program, f
        self.kinds = [(f.lanes, True), (f.lanes, False)]
        if f.lanes >= 4:
            self.kinds.append((f.lanes // 2, False))
        self._tables: list[str] = []
        self._extra: dict[int, int] = {}
        self._lists: dict[Listing, int] = {}
        self._slots = schedule.size
        self._declared: set[str] = set()

    @property
    def scratch(self) -> int:
        """Bytes of scratch for one block of states, once all tables are written."""
        return max(1, self._slots) * self.f.vector_bytes

    def table(self, item: Read | Write) -> tuple[str, list[int]]:
        """Write down which scalars an item moves: the name of that table, and how many groups in it are of each kind."""
        f, reads = self.f, isinstance(item, Read)
        size = (self.program.arguments if reads else self.program.results)[item.array].size
        groups: dict[int, dict[int, int]] = {}
        if self.program.watched and reads:  # what is not used is looked at too
            groups = {first: {} for first in range(0, size, f.lanes)}
        for k, i in item.scalars:
            groups.setdefault(k - k % f.lanes, {})[k % f.lanes] = i
        rows: list[list[list[int]]] = [[] for _ in self.kinds]
        for first, nodes in sorted(groups.items()):  # memory is touched in order
            present = min(f.lanes, size - first)
            places = [self.place(nodes.get(k, _NOWHERE if reads else _ZERO)) for k in range(f.lanes)]
            kind = max(k for k, (width, full) in enumerate(self.kinds) if present == width or (present < width and not full))
            rows[kind].append([first * f.bytes, present, *places])
        name, of = f"@groups{len(self._tables)}", f"[{2 + f.lanes} x i32]"
        entries = [f"{of} [{', '.join(f'i32 {x}' for x in row)}]" for kind in rows for row in kind]
        self._tables.append(f"{name} = internal constant [{len(entries)} x {of}] [{', '.join(entries)}]")
        return name, [len(kind) for kind in rows]

    def texts(self) -> list[str]:
        """The tables, and the functions `constants`, `read` and `write`."""
        return [
            *self._tables,
            self._constants(),
            self._addresses(),
            self._mover(reads=True),
            self._mover(reads=False),
            *sorted(self._declared),
        ]

    def place(self, i: int) -> int:
        """Where a node is in scratch; constants are put there, and what nobody wants has a place too."""
        if i >= 0 and self.schedule.nodes[i][0] != "const":
            return self.schedule.slot(i) * self.f.vector_bytes
        return self._more(i)

    def address(self, table: int) -> int:
        """Where in scratch the address of a table is [bytes]."""
        return self._more(_TABLES - table)

    def turn(self, loop: int) -> int:
        """Where in scratch the number of the row is that a loop over rows is at [bytes]."""
        return self._more(_TURNS - loop)

    def list_of(self, rows: Listing) -> int:
        """Where in scratch a list of rows is [bytes]."""
        if rows not in self._lists:
            self._lists[rows] = self._slots * self.f.vector_bytes
            self._slots += -(-8 * (1 + len(rows.numbers)) // self.f.vector_bytes)
        return self._lists[rows]

    def _more(self, i: int) -> int:
        if i not in self._extra:
            self._extra[i] = self._slots
            self._slots += 1
        return self._extra[i] * self.f.vector_bytes

    def _addresses(self) -> str:
        """The function `void addresses(scratch, table)` that puts the addresses of tables there."""
        text = Text(self.f)
        for key in [key for key in self._extra if _TURNS < key <= _TABLES]:
            text.keep(text.word("%table", 4 * (_TABLES - key)), text.at("%scratch", self.address(_TABLES - key)))
        return text.function("void", "addresses", "ptr noalias %scratch, ptr %table")

    def _constants(self) -> str:
        """The function `void constants(scratch)` that puts the constants among what is written into scratch."""
        text, f = Text(self.f), self.f
        for i, slot in self._extra.items():
            if i > _TABLES and i != _NOWHERE:
                x = f.constant(0.0 if i == _ZERO else self.schedule.nodes[i][1])
                text.do(f"store {text.V} {x}, ptr {text.at('%scratch', slot * f.vector_bytes)}, align {f.vector_bytes}")
        return text.function("void", "constants", "ptr noalias %scratch")

    def _mover(self, reads: bool) -> str:
        """The function that moves a table's groups; tells whether a number is not finite.

        `entry` is the array's in the kernel's table, `offsets` has for each lane how far its state is from the first, which is
        number `state`, and `turn` counts rows.
        """
        text, f = Text(self.f), self.f
        data, stride, row = (text.word("%entry", k) for k in range(3))
        base = text.at(text.let(f"inttoptr i64 {data} to ptr"), text.integer("mul", "%state", stride))
        base = text.at(base, text.integer("mul", "%turn", row))
        states = [text.at(base, text.word("%offsets", lane)) for lane in range(f.lanes)]
        sums, groups, size = [f.constant(0.0)] * min(4, f.lanes), "%groups", 4 * (2 + f.lanes)
        for kind, (width, full) in enumerate(self.kinds):
            with text.loop(f"%count{kind}", text.V, sums) as turn:
                group = text.at(groups, text.integer("mul", turn.k, size))
                first, present, *places = (text.load(text.at(group, 4 * k), "i32", 4) for k in range(2 + width))
                mask = "" if full or f.lanes == 1 else _first(text, present, width)
                first, *places = (text.let(f"sext i32 {x} to i64") for x in (first, *places))
                here = [text.at(state, first) for state in states]
                slots = [text.at("%scratch", place) for place in places]
                seen = self._read(text, here, slots, mask) if reads else self._write(text, here, slots, mask)
                turn.following = list(turn.values)
                for n, x in enumerate(seen):  # 0 x is a number if x is one
                    n %= len(sums)
                    turn.following[n] = text.intrinsic("fma", x, f.constant(0.0), turn.following[n])
            sums = turn.values
            groups = text.at(groups, text.integer("mul", f"%count{kind}", size))
        total, *others = sums
        for x in others:
            total = text.let(f"fadd {text.V} {total}, {x}")
        flag = text.any(text.let(f"fcmp uno {text.V} {total}, {total}"))
        counts = "".join(f", i64 %count{kind}" for kind in range(len(self.kinds)))
        arguments = f"ptr %entry, ptr %offsets, ptr noalias %scratch, i64 %state, i64 %turn, ptr %groups{counts}"
        return text.function("i64", "read" if reads else "write", arguments, flag)

    def _read(self, text: Text, states: Sequence[str], slots: Sequence[str], mask: str) -> list[str]:
        """Move a group of as many scalars as there are slots; what was read, in registers."""
        f, width = self.f, len(slots)
        kind, suffix = self._part(width)
        rows = []
        for pointer in states:
            if not mask:
                rows.append(text.load(pointer, kind, f.bytes))
                continue
            self._declared.add(f"declare {kind} @llvm.masked.load.{suffix}.p0(ptr, i32, <{width} x i1>, {kind})")
            given = f"ptr {pointer}, i32 {f.bytes}, <{width} x i1> {mask}, {kind} zeroinitializer"
            rows.append(text.let(f"call {kind} @llvm.masked.load.{suffix}.p0({given})"))
        if width < f.lanes:  # two states in a register
            rows = [text.shuffle(kind, a, b, range(f.lanes)) for a, b in zip(rows[:width], rows[width:], strict=True)]
        for x, slot in zip(transposed(text, rows), slots, strict=True):
            text.do(f"store {text.V} {x}, ptr {slot}, align {f.vector_bytes}")
        return rows

    def _write(self, text: Text, states: Sequence[str], slots: Sequence[str], mask: str) -> list[str]:
        """The reverse of `_read`."""
        f, width = self.f, len(slots)
        kind, suffix = self._part(width)
        seen = [text.load(slot, text.V, f.vector_bytes) for slot in slots]
        rows = transposed(text, seen)
        if width < f.lanes:
            rows = [text.shuffle(text.V, x, "poison", range(a, a + width)) for a in (0, width) for x in rows]
        for x, pointer in zip(rows, states, strict=True):
            if not mask:
                text.do(f"store {kind} {x}, ptr {pointer}, align {f.bytes}")
                continue
            self._declared.add(f"declare void @llvm.masked.store.{suffix}.p0({kind}, ptr, i32, <{width} x i1>)")
            text.do(
                f"call void @llvm.masked.store.{suffix}.p0({kind} {x}, ptr {pointer}, i32 {f.bytes}, <{width} x i1> {mask})"
            )
        return seen

    def _part(self, width: int) -> tuple[str, str]:
        """Type and suffix of a vector of so many numbers."""
        part = Format(width, self.f.single)
        return part.vector(part.number), part.suffix


def _first(text: Text, count: str, width: int) -> str:
    """A mask of the first `count` of so many numbers."""
    kind = f"<{width} x i32>"
    spread = text.shuffle(kind, text.let(f"insertelement {kind} poison, i32 {count}, i32 0"), "poison", [0] * width)
    return text.let(f"icmp slt {kind} <{', '.join(f'i32 {n}' for n in range(width))}>, {spread}")


def transposed(text: Text, rows: Sequence[str]) -> list[str]:
    """A square of numbers, or two side by side, turned: neighbours exchange halves, at distance 1, 2, 4 …"""
    lanes, rows = text.f.lanes, list(rows)
    distance = 1
    while distance < len(rows):
        low = [k - distance + lanes if k & distance else k for k in range(lanes)]
        high = [k + lanes if k & distance else k + distance for k in range(lanes)]
        for r in range(len(rows)):
            if not r & distance:
                a, b = rows[r], rows[r + distance]
                rows[r], rows[r + distance] = (text.shuffle(text.V, a, b, picks) for picks in (low, high))
        distance *= 2
    return rows
