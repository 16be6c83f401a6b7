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

_SIDE_BY_SIDE = 2
"""Registers of elements whose work is interleaved: while one waits for a quotient the other goes on."""
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


def stream_kernel(stream: Stream, single: bool, lanes: int | None = None) -> Kernel:
    """A stream as machine code: from the disk, or made now.

    It is called with its carried planes, its fixed planes, and an array of the numbers; the number of turns is a parameter. It
    tells of numbers that are not finite.
    """
    from articulated.compiler.machine import machine

    on = machine()
    f = Format(_SIDE_BY_SIDE * on.register // (4 if single else 8) if lanes is None else lanes, single)
    fixed = stream.carried + stream.fixed

    def turn(x: Sequence[Scalar]) -> Sequence[Scalar]:
        return stream.turn(x[: stream.carried], x[stream.carried : fixed], x[fixed:])

    work = Straight.of(turn, fixed + stream.numbers, single)
    assert len(work.outputs) == stream.carried + stream.numbers, f"{stream.name}: {len(work.outputs)} numbers are carried on"
    counts = repr((stream.carried, stream.fixed, stream.numbers)).encode()

    def build() -> tuple[dict[str, Any], bytes]:
        code = on.object_code(_module(stream, work, f))
        return {"operations": len(work.order()), "scratch": 1, "tile": 1, "objects": [len(code)]}, code

    return Kernel(stream.name, f, on, *kept(stream.name, f, on, counts + work.content, build))


def _module(stream: Stream, work: Straight, f: Format) -> str:
    text, planes = Text(f), stream.carried + stream.fixed
    where = [text.word("%table", 4 * k, "ptr") for k in range(planes + 1)]
    numbers = [text.spread(text.load(text.at(where[planes], k * f.bytes), f.number, f.bytes)) for k in range(stream.numbers)]
    turns = text.word("%table", 4 * (planes + 1))
    blocks = text.integer("sdiv", text.integer("sub", "%end", "%begin"), f.lanes)
    first = text.integer("mul", "%begin", f.bytes)
    with text.loop(blocks, text.V, ["zeroinitializer"]) as block:
        here = text.integer("add", first, text.integer("mul", block.k, f.vector_bytes))
        at = [text.at(plane, here) for plane in where[:planes]]
        loaded = [text.load(place, text.V, f.vector_bytes) for place in at]
        with text.loop(turns, text.V, [*loaded[: stream.carried], *numbers]) as turn:
            begun = [*turn.values[: stream.carried], *loaded[stream.carried :], *turn.values[stream.carried :]]
            turn.following = work.written(text, dict(zip(work.inputs, begun, strict=True)))
        for place, x in zip(at[: stream.carried], turn.values, strict=False):
            text.do(f"store {text.V} {x}, ptr {place}, align {f.vector_bytes}")
        block.following = [text.marked(block.values[0], turn.values[: stream.carried])]
    flags = text.flag(block.values[0], NOT_FINITE_OUT)
    arguments = "ptr %table, ptr %scratch, i64 %begin, i64 %end, i64 %tile"
    return module_of([text.function("i64", "kernel", arguments, flags, linkage="")], f)


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
