"""Streams: the same work on each of many elements, from planes of memory and back to them.

A plane has one number of each element, those of neighbours side by side. So registers are filled by loads alone, and as there
is no scratch, all that happens to an element happens in registers, however many turns it takes.

A kernel is that of `lowering`, `i64 kernel(table, scratch, begin, end, tile)`: its table has the address of each plane first,
then that of the call's numbers, four integers each, then how many turns to take. Planes are as long as a whole number of
registers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.compiler.ir import Format, Text
from articulated.compiler.kernels import Kernel, kept
from articulated.compiler.lowering import NOT_FINITE_OUT, module_of
from articulated.compiler.straight import Straight
from articulated.scalar import Scalar

_SIDE_BY_SIDE, _BESIDE = 2, 2
"""Registers of elements whose work is interleaved: while one waits for a quotient the other goes on. Of several turns so many
of these groups are done in each, with branches of their own: a processor looks far enough ahead to begin with the second."""
_BLOCK, _LINE = 64, 512
"""Elements, and bytes, to which planes are rounded up: registers of any format fit."""

Turn = Callable[[Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]], Sequence[Scalar]]


@dataclass(frozen=True, eq=False)
class Stream:
    """Work on elements.

    Attributes:
        name: for dumps.
        carried: how many planes it takes and writes back.
        fixed: how many planes it takes besides.
        numbers: how many numbers of the call are the same for all elements; they are carried from turn to turn too.
        turn: from what is carried, what is fixed, and the numbers to what is carried on, then the numbers of the next turn.
    """

    name: str
    carried: int
    fixed: int
    numbers: int
    turn: Turn


def stream_kernel(stream: Stream, single: bool) -> Kernel:
    """A stream as machine code: from the disk, or made now.

    It is called with its carried planes, its fixed planes, and an array of the numbers; the number of turns is a parameter. It
    tells of numbers that are not finite.
    """
    from articulated.compiler.machine import machine

    on = machine()
    f = Format(_SIDE_BY_SIDE * on.register // (4 if single else 8), single)
    whole = Format(_BESIDE * f.lanes, single)
    fixed = stream.carried + stream.fixed

    def turn(x: Sequence[Scalar]) -> Sequence[Scalar]:
        return stream.turn(x[: stream.carried], x[stream.carried : fixed], x[fixed:])

    work = Straight.of(turn, fixed + stream.numbers, single)
    assert len(work.outputs) == stream.carried + stream.numbers, f"{stream.name}: {len(work.outputs)} numbers are carried on"
    counts = repr((stream.carried, stream.fixed, stream.numbers)).encode()

    def build() -> tuple[dict[str, Any], bytes]:
        code = on.object_code(_module(stream, work, f))
        return {"operations": len(work.order()), "scratch": 1, "tile": 1, "objects": [len(code)]}, code

    return Kernel(stream.name, whole, on, *kept(stream.name, whole, on, counts + work.content, build))


_ARGUMENTS = "ptr %table, ptr %scratch, i64 %begin, i64 %end, i64 %tile"


def _module(stream: Stream, work: Straight, f: Format) -> str:
    text = Text(f)
    alone = text.let(f"icmp eq i64 {text.word('%table', 4 * (stream.carried + stream.fixed + 1))}, 1")
    go = text.let(f"select i1 {alone}, ptr @once, ptr @often")
    kernel = text.function("i64", "kernel", _ARGUMENTS, text.let(f"call i64 {go}({_ARGUMENTS})"), linkage="")
    return module_of([kernel, _function("once", stream, work, f, 1), _function("often", stream, work, f, _BESIDE)], f)


def _function(name: str, stream: Stream, work: Straight, f: Format, beside: int) -> str:
    """All turns of all elements, so many registers and groups of them in a turn."""
    text, planes, c = Text(f), stream.carried + stream.fixed, stream.carried
    where = [text.word("%table", 4 * k, "ptr") for k in range(planes + 1)]
    numbers = [text.spread(text.load(text.at(where[planes], k * f.bytes), f.number, f.bytes)) for k in range(stream.numbers)]
    turns = text.word("%table", 4 * (planes + 1))
    groups = text.integer("sdiv", text.integer("sub", "%end", "%begin"), beside * f.lanes)
    first = text.integer("mul", "%begin", f.bytes)
    with text.loop(groups, text.V, ["zeroinitializer"]) as group:
        here = text.integer("add", first, text.integer("mul", group.k, beside * f.vector_bytes))
        at = [
            [text.at(plane, text.integer("add", here, b * f.vector_bytes)) for plane in where[:planes]] for b in range(beside)
        ]
        loaded = [[text.load(place, text.V, f.vector_bytes) for place in places] for places in at]
        with text.loop(turns, text.V, [*(x for some in loaded for x in some[:c]), *numbers]) as turn:
            for b, some in enumerate(loaded):
                begun = [*turn.values[b * c : b * c + c], *some[c:], *turn.values[beside * c :]]
                done = work.written(text, dict(zip(work.inputs, begun, strict=True)))
                turn.following += done[:c]
            turn.following += done[c:]  # the same for all
        carried = turn.values[: beside * c]
        for place, x in zip((place for places in at for place in places[:c]), carried, strict=True):
            text.do(f"store {text.V} {x}, ptr {place}, align {f.vector_bytes}")
        group.following = [text.marked(group.values[0], carried)]
    flags = text.flag(group.values[0], NOT_FINITE_OUT)
    return text.function("i64", name, _ARGUMENTS, flags)


def planes(rows: Sequence[np.ndarray], dtype: Any = float) -> np.ndarray:
    """Planes of numbers for a kernel, shape (k, m): of elements, then the last one again until registers are full."""
    n = len(rows[0])
    result = on_a_line((len(rows), -(-max(n, 1) // _BLOCK) * _BLOCK), dtype)
    for plane, row in zip(result, rows, strict=True):
        plane[:n], plane[n:] = row, row[-1] if n else 0.0
    return result


def on_a_line(shape: tuple[int, ...], dtype: Any = float) -> np.ndarray:
    """Room for numbers that begins where any register may be loaded from."""
    size = np.dtype(dtype).itemsize * math.prod(shape)
    room = np.empty(size + _LINE, np.uint8)
    start = -room.ctypes.data % _LINE
    return room[start : start + size].view(dtype).reshape(shape)
