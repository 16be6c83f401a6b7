"""Kernels: programs as machine code that runs on numpy arrays."""

from __future__ import annotations

import ctypes
import hashlib
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from articulated.compiler import cache as disk
from articulated.compiler.ir import Format
from articulated.compiler.light import address_of, light_function
from articulated.compiler.lowering import Lowering
from articulated.compiler.program import Program, Tape
from articulated.compiler.schedule import Chunk, Schedule, flattened, schedule
from articulated.compiler.threads import TABLE, crew, default_threads

if TYPE_CHECKING:
    from articulated.compiler.machine import Machine

_RUN = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 3)
_PATIENCE = 2.0
"""How long compiling may take before a bar tells how far it is [s]."""
_SHARE = 100e-6
"""Work worth giving to one more thread [s]."""
_PART = 10e-6
"""Work worth being fetched by a thread [s]; a thread fetches what it does in several parts."""
_PARTS = 32
_OPERATION = 0.4e-9
"""About what an operation takes, for a whole vector [s]."""


class Kernel:
    """A program as machine code.

    Attributes:
        name: of the program.
        format: number format, and states that a block holds.
        ordered: whether the program is; see there.
    """

    def __init__(self, name: str, f: Format, on: Machine, header: dict[str, Any], code: bytes, ordered: bool = False):
        self.name, self.format, self.ordered = name, f, ordered
        self._block: float = header["operations"] * _OPERATION  # about how long one takes [s]
        self._tile: int = header["tile"]
        self._scratch_bytes: int = header["scratch"] * header["tile"]
        ends = list(accumulate(header["objects"], initial=0))
        self._engine = on.load([code[a:b] for a, b in pairwise(ends)])  # the code lives as long as this does
        self._address: int = self._engine.get_function_address("kernel")
        self._run = _RUN(self._address)
        self._scratch: list[tuple[np.ndarray, int]] = []  # memory, and where in it a line begins

    def address(self, name: str) -> int:
        """Of a function or variable in its code."""
        return self._engine.get_function_address(name) or self._engine.get_global_value_address(name)

    def light(self) -> Callable[..., bool] | None:
        """Itself as a Python function in machine code; see `light`."""
        return light_function(self.name, self.format, self.address, self)

    def __call__(
        self,
        arrays: Sequence[tuple[np.ndarray, int, int, np.ndarray | None]],
        batch: int,
        threads: int | None,
        parameters: Sequence[int] = (),
        turns: int = 1,
        order: np.ndarray | None = None,
    ) -> int:
        """Run it on a batch; the flags of `lowering`.

        Args:
            arrays: each argument, then each result, with the bytes from state to state and from row to row, and the numbers of
                the rows that turns take (an argument with rows; else None).
            batch: number of states, one or more.
            threads: how many may share it; None is as many as are useful.
            parameters: the program's integers.
            turns: how often most of its code runs.
            order: in which to take the states, if it is an ordered program; None is the order in which they stand.
        """
        entries: list[int] = []
        for array, state, row, rows in arrays:
            entries += (address_of(array), state, row, 0 if rows is None else address_of(rows))
        if self.ordered:
            order = np.arange(batch) if order is None else np.ascontiguousarray(order, np.int64)
            entries.append(address_of(order))
        return self._called((ctypes.c_int64 * (len(entries) + len(parameters)))(*entries, *parameters), batch, threads, turns)

    def bound(self, arrays: Sequence[np.ndarray], parameters: int) -> Bound:
        """Itself with arrays, for calls that differ in so many parameters only."""
        return Bound(self, arrays, parameters)

    def _called(self, table: ctypes.Array, batch: int, threads: int | None, turns: int) -> int:
        threads = self.threads(batch, threads, turns)
        if threads > 1 and (job := self.job(batch, threads, turns)) is not None:
            try:
                job[TABLE] = ctypes.addressof(table)
                return crew.run(job)
            finally:
                crew.done()
        try:
            scratch = self._scratch.pop()
        except IndexError:
            memory = np.empty(self._scratch_bytes + 64, np.uint8)
            scratch = memory, -(-address_of(memory) // 64) * 64
        flags = self._run(ctypes.addressof(table), scratch[1], 0, batch, self._tile)
        self._scratch.append(scratch)
        return flags

    def threads(self, batch: int, threads: int | None, turns: int = 1) -> int:
        """How many threads to use, of so many; None is as many as are useful."""
        if threads is None:
            work = self.cost(batch) * turns
            threads = 1 if work < 2.0 * _SHARE else min(default_threads(), int(work / _SHARE))
        return max(1, min(threads, self._blocks(batch)))

    def job(self, batch: int, threads: int, turns: int = 1) -> np.ndarray | None:
        """A job for several threads; see `Crew.take`."""
        blocks = self._blocks(batch)
        parts = min(blocks, max(threads, min(_PARTS * threads, int(self.cost(batch) * turns / _PART))))
        together = self._tile if parts * self._tile < blocks else 1
        size = -(-blocks // (parts * together)) * together * self.format.lanes
        return crew.take(self._address, self._scratch_bytes, batch, size, self._tile, threads)

    def cost(self, batch: int) -> float:
        """About how long it takes for a batch on one thread, if each of its chunks runs once [s]."""
        return self._blocks(batch) * self._block

    def _blocks(self, batch: int) -> int:
        return -(-batch // self.format.lanes)


class Bound:
    """A kernel with its arrays, which have no states or rows that it should know of."""

    def __init__(self, kernel: Kernel, arrays: Sequence[np.ndarray], parameters: int):
        assert all(array.dtype in (kernel.format.dtype, np.int32) for array in arrays), (
            f"{kernel.name}: numbers of another format"
        )
        self._kernel, self._arrays, self._first = kernel, tuple(arrays), 4 * len(arrays)
        self._table = (ctypes.c_int64 * (self._first + parameters))()
        for k, array in enumerate(arrays):
            self._table[4 * k : 4 * k + 2] = address_of(array), array.itemsize

    def __call__(self, batch: int, threads: int | None, parameters: Sequence[int], turns: int = 1) -> int:
        """See `Kernel`; numbers in its arrays may have changed."""
        self._table[self._first :] = parameters
        return self._kernel._called(self._table, batch, threads, turns)


_kernels: WeakKeyDictionary[Any, dict[Any, Any]] = WeakKeyDictionary()


def kernels_of(owner: Any) -> dict[Any, Any]:
    """The kernels made for an object so far, to be looked up and added to; they go when it goes."""
    known = _kernels.get(owner)
    if known is None:
        known = _kernels.setdefault(owner, {})
    return known


def compiled(program: Program, single: bool, lanes: int | None = None) -> Kernel:
    """The kernel of a program: from the disk, or made now.

    Args:
        program: what to compile.
        single: for float32.
        lanes: states in a block; None is as many as a register holds, or half as many; 1 is for a single state.
    """
    from articulated.compiler.machine import machine  # LLVM takes a while to load

    on = machine()
    if lanes is None:
        lanes = on.register // (4 if single else 8)
        if single and program.ordered:  # states take different times: of sixteen too many wait for the slowest
            lanes //= 2
    f = Format(lanes, single)
    entry = kept(program.name, f, on, program.content, lambda: _build(program, f, on))
    return Kernel(program.name, f, on, *entry, program.ordered)


def kept(
    name: str, f: Format, on: Machine, content: bytes, build: Callable[[], tuple[dict[str, Any], bytes]]
) -> tuple[dict[str, Any], bytes]:
    """The header and object code of a kernel: from the disk, or what `build` makes.

    Args:
        name, f, on: of the kernel; see `Kernel`.
        content: all else that decides what it does.
        build: makes them.
    """
    key = hashlib.sha256(b"\0".join([_SOURCE, on.identity, repr((name, f)).encode(), content])).hexdigest()
    entry = disk.get(key)
    if entry is None or set(entry[0]) != {"operations", "scratch", "tile", "objects"}:
        entry = build()
        disk.put(key, *entry)
    return entry


def _build(program: Program, f: Format, on: Machine) -> tuple[dict[str, Any], bytes]:
    """Compile a program; if that takes long, a bar on the terminal tells how far it is."""
    from tqdm import tqdm

    began = time.monotonic()
    tape = Tape(program, f.single)
    watched = range(len(program.arguments)) if program.watched else ()
    plan = schedule(tape.graph, tape.outputs, tape.check, f.lanes, watched)
    lowering = Lowering(plan, program, f)
    modules = lowering.modules
    delay = max(_PATIENCE - (time.monotonic() - began), 1e-9)
    bar = tqdm(modules, f"compiling {program.name}", delay=delay, disable=None, leave=False, unit="part")
    objects = [on.object_code(text) for text in bar]
    header = {
        "operations": lowering.operations,
        "scratch": lowering.scratch,
        "tile": lowering.tile,
        "objects": [len(code) for code in objects],
    }
    if folder := os.environ.get("ARTICULATED_DUMP"):
        _dump(Path(folder) / f"{program.name}-{on.name}-{f.number}x{f.lanes}", plan, modules, header, on)
    return header, b"".join(objects)


def _dump(path: Path, plan: Schedule, modules: Sequence[str], header: dict[str, Any], on: Machine) -> None:
    """Write what became of a program where people can read it: statistics, LLVM IR, assembly."""
    path.parent.mkdir(parents=True, exist_ok=True)
    count = Counter(node[0] for node in plan.operations())
    lines = [f"operations  {header['operations']}", *(f"  {name:<10}{n}" for name, n in count.most_common())]
    lines += [
        f"chunks      {sum(isinstance(item, Chunk) for item in flattened(plan.items))}",
        f"scratch     {header['scratch']} bytes",
    ]
    lines += [f"code        {sum(header['objects'])} bytes in {len(modules)} objects"]
    path.with_suffix(".txt").write_text("\n".join([*lines, ""]))
    path.with_suffix(".ll").write_text("\n; next module\n\n".join(modules))
    path.with_suffix(".s").write_text("\n".join(on.assembly(text) for text in modules))


def _source() -> bytes:
    """What this project's own code is: kernels made by another version are not ours."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.digest()


_SOURCE = _source()  # now, before anybody edits what runs
