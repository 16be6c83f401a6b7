"""From a schedule to LLVM IR: the kernel's own function, and the modules that make up a kernel.

A kernel is `i64 kernel(table, scratch, begin, end, tile)`. It handles the states from `begin` to `end` in blocks of as many
as a register has lanes, and runs each chunk for `tile` blocks before the next, so that code which outgrows the instruction
cache is fetched less often. A last block that is not full overlaps the one before it; if there is none, missing states repeat
the last one. So nothing is read or written out of bounds, and a state's bits do not depend on where it stands.

The table has four integers for each array, arguments first: address, bytes from state to state, bytes from row to row, and,
for an argument with rows, the address of the numbers of the rows that the turns of its loop take. Then come, for a program that
is ordered, the address of the numbers of the states, and the parameters.
The kernel returns flags: 1 if an argument, 2 if a result is not finite, 4 if a check fails.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from articulated.compiler.graph import Parameter
from articulated.compiler.ir import ATTRIBUTES, Format, Text
from articulated.compiler.light import STACK, light_text
from articulated.compiler.listing import Listing, known, list_function, listing, wanted
from articulated.compiler.operations import chunk_function, mask_function
from articulated.compiler.program import Program
from articulated.compiler.schedule import Check, Chunk, Exit, Item, Read, Repeat, Schedule, Write
from articulated.compiler.transfers import Transfers

NOT_FINITE_IN, NOT_FINITE_OUT, CHECK_FAILED = 1, 2, 4

_MODULE = 4
"""Chunks in a module."""
_INSTRUCTIONS = 4000
"""Operations whose code fits into the instruction cache. Larger programs run each chunk for several blocks before the next."""
_TILE = 4


class Lowering:
    """A program as LLVM IR.

    Attributes:
        modules: the kernel's own module, then those with the chunks, each small enough to be compiled in a moment.
        operations: on each block, once through.
        scratch: bytes that the kernel needs for each block of a tile.
        tile: how many blocks it had best run a chunk for.
    """

    def __init__(self, schedule: Schedule, program: Program, f: Format):
        kernel = _Kernel(schedule, program, f)
        text = kernel.function()
        chunks, self.scratch = kernel.chunks, kernel.transfers.scratch
        self.operations = sum(1 for _ in schedule.operations())
        early = program.ordered or any(loop.until is not None for loop in schedule.loops)  # fewer states end sooner
        self.tile = _TILE if f.lanes > 1 and self.operations > _INSTRUCTIONS and not early else 1
        arrays = (*program.arguments, *program.results)
        small = self.scratch * self.tile <= STACK and (f.lanes > 1 or not f.single)
        plain = small and not program.ordered and not any(array.rows or array.table for array in arrays)
        light = [light_text(program, f, self.scratch, self.tile)] if plain else []
        declared = [f"declare void @chunk{k}(ptr)" for k in range(len(chunks))]
        size = f"@size = internal constant i64 {self.scratch}"
        main = [size, *kernel.masks, *kernel.lists.values(), *kernel.transfers.texts(), _turn(f), text, *light, *declared]
        rest = [chunks[k : k + _MODULE] for k in range(0, len(chunks), _MODULE)]
        self.modules = [module_of(functions, f) for functions in (main, *rest)]


def _turn(f: Format) -> str:
    """The function `void turn(scratch, k, at)` that puts the number of a row there."""
    text = Text(f)
    text.keep("%k", text.at("%scratch", "%at"))
    return text.function("void", "turn", "ptr noalias %scratch, i64 %k, i64 %at")


def module_of(functions: Sequence[str], f: Format) -> str:
    """A module of functions, with the declarations that they need."""
    V = f.vector(f.number)
    declared = [
        f"declare {V} @llvm.{name}.{f.suffix}({', '.join([V] * n)})" for name, n in (("fma", 3), ("sqrt", 1), ("fabs", 1))
    ]
    declared += [f"declare i64 @llvm.{name}.i64(i64, i64)" for name in ("smin", "smax")]
    return "\n".join([*functions, *declared, f"attributes #0 = {{ {ATTRIBUTES} }}\n"])


class _Kernel:
    """The kernel's own function: loops, and calls of everything else."""

    def __init__(self, schedule: Schedule, program: Program, f: Format):
        self.schedule, self.program, self.f, self.text = schedule, program, f, Text(f)
        self.arrays = len(program.arguments) + len(program.results)
        self.transfers = Transfers(schedule, program, f)
        self.chunks: list[str] = []
        self.masks: list[str] = []
        self.lists: dict[Listing, str] = {}
        self._first = self._blocks = self._last = ""

    def function(self) -> str:
        """Write it all."""
        text, lanes, regions = self.text, self.f.lanes, 1 + len(self.schedule.loops)
        offsets, turns, flags = self.arrays * lanes, regions, 1
        for name, size in (("offsets", offsets), ("turns", turns), ("flags", flags)):
            text.do(f"%{name} = alloca [{size} x i64]")
        text.keep(0, "%flags")
        count = text.integer("sub", "%end", "%begin")
        self._last = text.integer("smax", text.integer("sub", "%end", lanes), "%begin")
        for lane in range(lanes):
            self._place(lane, text.integer("smin", lane, text.integer("sub", count, 1)))
        blocks = text.integer("sdiv", text.integer("add", count, lanes - 1), lanes)
        self._first, self._blocks = "%begin", text.integer("smin", blocks, "%tile")
        self._each(lambda scratch, state: f"@constants(ptr {scratch})", tells=False)
        self._each(lambda scratch, state: f"@addresses(ptr {scratch}, ptr %table)", tells=False)
        tiles = text.integer("sdiv", text.integer("add", blocks, text.integer("sub", "%tile", 1)), "%tile")
        with text.loop(tiles) as tile:
            before = text.integer("mul", tile.k, "%tile")
            self._first = text.integer("add", "%begin", text.integer("mul", before, lanes))
            self._blocks = text.integer("smin", text.integer("sub", blocks, before), "%tile")
            for k in range(regions):
                text.keep(0, text.entry("%turns", k))
            if self.program.ordered:
                first, order = text.integer("smin", self._first, self._last), text.word("%table", 4 * self.arrays, "ptr")
                for lane in range(lanes):
                    place = text.integer("smin", text.integer("add", first, lane), text.integer("sub", "%end", 1))
                    self._place(lane, text.word(order, place))
            self._items(self.schedule.items, "")
        arguments = "ptr %table, ptr noalias %scratch, i64 %begin, i64 %end, i64 %tile"
        return text.function("i64", "kernel", arguments, text.word("%flags"), linkage="")

    def _place(self, lane: int, state: str) -> None:
        """Tell that a lane has the state so many on from a block's first, or of all, if they are taken in an order."""
        text = self.text
        for a in range(self.arrays):
            offset = text.integer("mul", state, text.word("%table", 4 * a + 1))
            text.keep(offset, text.entry("%offsets", a * self.f.lanes + lane))

    def _items(self, items: Sequence[Item], end: str) -> None:
        """Write what the items do; `end` is where the innermost loop ends."""
        here = known(items, self.schedule)
        for item in items:
            self._list([item], here)
            if isinstance(item, Chunk):
                if item.nodes or item.copies or item.yields:
                    name, rows = f"chunk{len(self.chunks)}", listing(item, self.schedule)
                    place = self.transfers.list_of(rows) if rows in self.lists else None
                    self.chunks.append(chunk_function(name, item, self.schedule, self.f, self.transfers, place))
                    self._each(lambda scratch, state, name=name: f"@{name}(ptr {scratch})", tells=False)
            elif isinstance(item, Repeat):
                self._repeat(item)
            elif isinstance(item, (Exit, Check)):
                name = f"mask{len(self.masks)}"
                self.masks.append(mask_function(name, item.mask, isinstance(item, Check), self.schedule, self.f))
                some = self._each(lambda scratch, state, name=name: f"@{name}(ptr {scratch})")
                if isinstance(item, Check):
                    self._raise(some, CHECK_FAILED)
                else:
                    proceed = self.text.label()
                    self.text.branch(self.text.let(f"icmp eq i64 {some}, 0"), end, proceed)
                    self.text.begin(proceed)
            else:
                self._transfer(item)

    def _list(self, items: Sequence[Item], here: set[int]) -> None:
        """Write the lists that items need of rows whose numbers are known here, unless they are written."""
        for rows in wanted(items, self.schedule):
            if rows not in self.lists and here.issuperset(rows.numbers):
                name, places = f"list{len(self.lists)}", [self.transfers.place(i) for i in rows.numbers]
                self.lists[rows] = list_function(name, rows, self.transfers.list_of(rows), places, self.f)
                self._each(lambda scratch, state, name=name: f"@{name}(ptr {scratch})", tells=False)

    def _repeat(self, item: Repeat) -> None:
        if item.items and isinstance(chunk := item.items[0], Chunk) and chunk.rows is item.loop:
            self._items(item.items, "")
            return
        text, count = self.text, item.loop.count
        if isinstance(count, Parameter):
            count = text.word("%table", 4 * self.arrays + self.program.ordered + count.index)
        with text.loop(count) as turn:
            if item.loop.columns:
                at = self.transfers.turn(item.loop.region)
                self._each(lambda scratch, state: f"@turn(ptr {scratch}, i64 {turn.k}, i64 {at})", tells=False)
            self._items(item.items, turn.end)
            taken = text.entry("%turns", item.loop.region)  # rows are counted on when the loop begins again
            text.keep(text.integer("add", text.word(taken), 1), taken)

    def _transfer(self, item: Read | Write) -> None:
        text, reads = self.text, isinstance(item, Read)
        table, counts = self.transfers.table(item)
        array = item.array + (0 if reads else len(self.program.arguments))
        entry, offsets = text.entry("%table", 4 * array), text.entry("%offsets", array * self.f.lanes)
        turn = text.word("%turns", item.loop)
        if reads and item.loop:
            turn = text.word(text.word(entry, 3, "ptr"), turn)
        groups = ", ".join([f"ptr {table}", *(f"i64 {count}" for count in counts)])
        move = f"@{'read' if reads else 'write'}(ptr {entry}, ptr {offsets}"
        some = self._each(lambda scratch, state: f"{move}, ptr {scratch}, i64 {state}, i64 {turn}, {groups})")
        if self.program.watched and not item.loop:
            self._raise(some, NOT_FINITE_IN if reads else NOT_FINITE_OUT)

    def _each(self, call: Callable[[str, str], str], tells: bool = True) -> str:
        """Call a function for each block of the tile, given its scratch and first state; whether any call `tells`, by a 1."""
        text, size = self.text, self.text.word("@size")
        with text.loop(self._blocks, "i64", ["0"]) as turn:
            scratch = text.at("%scratch", text.integer("mul", turn.k, size))
            ahead = text.integer("add", self._first, text.integer("mul", turn.k, self.f.lanes))
            called = call(scratch, "0" if self.program.ordered else text.integer("smin", ahead, self._last))
            if tells:
                turn.following = [text.integer("or", turn.values[0], text.let(f"call i64 {called}"))]
            else:
                text.do(f"call void {called}")
                turn.following = turn.values
        return turn.values[0]

    def _raise(self, some: str, flag: int) -> None:
        more = self.text.integer("mul", some, flag)
        self.text.keep(self.text.integer("or", self.text.word("%flags"), more), "%flags")
