"""LLVM IR as text: number formats, and functions being written."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

ATTRIBUTES = 'nounwind noinline "stackrealign" "prefer-vector-width"="512" "min-legal-vector-width"="512"'


class Pattern(NamedTuple):
    """Of a number's bits: how many are of the fraction; the pattern of 1, and that of √½."""

    shift: int
    one: int
    root: int


@dataclass(frozen=True)
class Format:
    """A number format and how many of them a register holds.

    Attributes:
        lanes: how many.
        single: whether it is float32, not float64.
        number, integer: LLVM's types of a number, and of an integer with as many bits.
    """

    lanes: int
    single: bool

    @property
    def bytes(self) -> int:
        return 4 if self.single else 8

    @property
    def dtype(self) -> np.dtype:
        """Of arrays of such numbers."""
        return np.dtype(np.float32 if self.single else np.float64)

    @property
    def vector_bytes(self) -> int:
        return self.bytes * self.lanes

    @property
    def number(self) -> str:
        return "float" if self.single else "double"

    @property
    def integer(self) -> str:
        return "i32" if self.single else "i64"

    @property
    def suffix(self) -> str:
        """Of the names of functions that take such vectors."""
        return ("" if self.lanes == 1 else f"v{self.lanes}") + ("f32" if self.single else "f64")

    @property
    def pattern(self) -> Pattern:
        if self.single:
            return Pattern(23, 0x3F800000, 0x3F3504F3)
        return Pattern(52, 0x3FF0000000000000, 0x3FE6A09E667F3BCD)

    def vector(self, of: str) -> str:
        return of if self.lanes == 1 else f"<{self.lanes} x {of}>"

    def rounded(self, x: float) -> float:
        """A constant as the format holds it."""
        return struct.unpack("f", struct.pack("f", x))[0] if self.single and abs(x) < 3.4e38 else x

    def constant(self, x: float) -> str:
        bits = f"0x{struct.pack('>d', self.rounded(x)).hex()}"
        return bits if self.lanes == 1 else f"splat ({self.number} {bits})"

    def integers(self, n: int) -> str:
        return str(n) if self.lanes == 1 else f"splat ({self.integer} {n})"


@dataclass(eq=False)
class Turn:
    """A turn of a loop.

    Attributes:
        k: its number.
        values: what the turn before handed on; after the loop, what the last one did.
        following: what it hands on itself, to be set.
        end: where the loop ends.
    """

    k: str
    values: list[str]
    end: str
    following: list[str] = field(default_factory=list)


class Text:
    """A function being written. `block` is the label of the block that is."""

    def __init__(self, f: Format):
        self.f, self.lines, self.names, self.block = f, ["start:"], 0, "start"
        self.V, self.N, self.M = f.vector(f.number), f.vector(f.integer), f.vector("i1")

    def do(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def let(self, text: str) -> str:
        self.names += 1
        self.do(f"%t{self.names} = {text}")
        return f"%t{self.names}"

    def at(self, pointer: str, offset: int | str) -> str:
        """So many bytes on."""
        return self.let(f"getelementptr i8, ptr {pointer}, i64 {offset}") if offset else pointer

    def load(self, pointer: str, kind: str, align: int) -> str:
        return self.let(f"load {kind}, ptr {pointer}, align {align}")

    def spread(self, x: str) -> str:
        """A number in all lanes."""
        if self.f.lanes == 1:
            return x
        first = self.let(f"insertelement {self.V} poison, {self.f.number} {x}, i32 0")
        return self.shuffle(self.V, first, "poison", [0] * self.f.lanes)

    def word(self, pointer: str, k: int | str = 0, kind: str = "i64") -> str:
        """The k-th of some integers of 64 bits, or pointers."""
        return self.let(f"load {kind}, ptr {self.entry(pointer, k)}")

    def entry(self, pointer: str, k: int | str) -> str:
        return self.let(f"getelementptr i64, ptr {pointer}, i64 {k}") if k else pointer

    def keep(self, x: int | str, pointer: str) -> None:
        self.do(f"store i64 {x}, ptr {pointer}")

    def integer(self, operation: str, a: int | str, b: int | str) -> str:
        """add, sub, mul, or, sdiv …; smin and smax."""
        if operation in ("smin", "smax"):
            return self.let(f"call i64 @llvm.{operation}.i64(i64 {a}, i64 {b})")
        return self.let(f"{operation} i64 {a}, {b}")

    def intrinsic(self, name: str, *operands: str) -> str:
        """LLVM's function of vectors: fma, sqrt, fabs."""
        return self.let(f"call {self.V} @llvm.{name}.{self.f.suffix}({', '.join(f'{self.V} {x}' for x in operands)})")

    def marked(self, mark: str, numbers: Sequence[str]) -> str:
        """A vector of zeros, or of what is not a number where any of these was not finite."""
        for x in numbers:
            nothing = self.let(f"fmul {self.V} {x}, zeroinitializer")
            mark = self.let(f"fadd {self.V} {mark}, {nothing}")
        return mark

    def flag(self, mark: str, flag: int) -> str:
        """This flag if a mark has what is not a number in some lane, else 0."""
        return self.integer("mul", self.any(self.let(f"fcmp uno {self.V} {mark}, {mark}")), flag)

    def shuffle(self, kind: str, a: str, b: str, picks: Sequence[int]) -> str:
        numbers = f"<{len(picks)} x i32> <{', '.join(f'i32 {k}' for k in picks)}>"
        return self.let(f"shufflevector {kind} {a}, {kind} {b}, {numbers}")

    def some(self, mask: str) -> str:
        """Whether a mask holds for some lane."""
        lanes = self.f.lanes
        if lanes == 1:
            return mask
        return self.let(f"icmp ne i{lanes} {self.let(f'bitcast <{lanes} x i1> {mask} to i{lanes}')}, 0")

    def any(self, mask: str) -> str:
        """1 if a mask holds for some lane, else 0."""
        return self.let(f"zext i1 {self.some(mask)} to i64")

    def label(self) -> str:
        self.names += 1
        return f"L{self.names}"

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")
        self.block = label

    def go(self, label: str) -> None:
        self.do(f"br label %{label}")

    def branch(self, condition: str, yes: str, no: str) -> None:
        self.do(f"br i1 {condition}, label %{yes}, label %{no}")

    @contextmanager
    def loop(self, count: int | str, kind: str = "i64", start: Sequence[str] = ()) -> Iterator[Turn]:
        """As many turns as `count` says, each handing values of one kind on to the next."""
        head, body, end = (self.label() for _ in range(3))
        turn = Turn(f"%{head}.k", [f"%{head}.{n}" for n in range(len(start))], end)
        before = self.block
        self.go(head)
        self.begin(head)
        place = len(self.lines)
        self.branch(self.let(f"icmp slt i64 {turn.k}, {count}"), body, end)
        self.begin(body)
        yield turn
        carried = [("i64", turn.k, "0", self.integer("add", turn.k, 1))]
        carried += [(kind, *values) for values in zip(turn.values, start, turn.following, strict=True)]
        self.lines[place:place] = [
            f"  {name} = phi {of} [ {first}, %{before} ], [ {then}, %{self.block} ]" for of, name, first, then in carried
        ]
        self.go(head)
        self.begin(end)

    def function(self, kind: str, name: str, arguments: str, result: str = "", linkage: str = "internal ") -> str:
        """All of it, with its head and its end."""
        self.do(f"ret {kind} {result}" if result else "ret void")
        return "\n".join([f"define {linkage}{kind} @{name}({arguments}) #0 {{", *self.lines, "}"])
