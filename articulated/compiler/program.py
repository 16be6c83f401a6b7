"""What is to be compiled: an algorithm over scalars, and the arrays that it takes and gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from articulated.compiler.graph import Graph, Parameter, Traced
from articulated.scalar import Nested, Scalar, flatten


@dataclass(frozen=True)
class Array:
    """An array argument or result.

    Attributes:
        name: for dumps and exported C.
        shape: of what belongs to one state.
        rows: whether each state has one such thing for each turn of a loop.
        table: whether it is one for all states, of which each takes what entries it likes; its first axis may have any length.
    """

    name: str
    shape: tuple[int, ...] = ()
    rows: bool = False
    table: bool = False

    @property
    def size(self) -> int:
        return math.prod(self.shape)


@dataclass(frozen=True, eq=False)
class Program:
    """An algorithm with its arrays.

    Attributes:
        name: for dumps, progress and exported C.
        content: all that decides what the algorithm does, as bytes: equal content, equal program.
        arguments, results: what it takes and gives, in order.
        write: runs the algorithm on traced scalars: takes a tape and a nested list (or `Rows`) for each argument, returns a
            nested list for each result that is not written by rows.
        unfit: from the same, a mask of the states that should not be computed with; None: there are none.
        watched: whether a kernel tells of numbers that are not finite.
        constants: values of arguments that C has as constants, by name.
        ordered: whether a call tells in which order to take the states: those that take as long had best be neighbours.
    """

    name: str
    content: bytes
    arguments: tuple[Array, ...]
    results: tuple[Array, ...]
    write: Callable[..., Sequence[Nested]]
    unfit: Callable[..., Any] | None = None
    watched: bool = True
    constants: Mapping[str, Sequence[float]] = field(default_factory=dict)
    ordered: bool = False


class Tape:
    """A program as it is written down.

    Attributes:
        graph: its operations.
        outputs: nodes of each result; none for a result that is written by rows.
        check: mask node, true for a state that should not be computed with; None for no check.
    """

    def __init__(self, program: Program, single: bool):
        self.program = program
        self.graph = Graph(single)
        self.check: int | None = None
        arguments = [self._argument(k, a) for k, a in enumerate(program.arguments)]
        plain = iter(program.write(self, *arguments))
        self.outputs = [[] if array.rows else self._nodes(array, next(plain)) for array in program.results]
        if program.unfit is not None and isinstance(mask := program.unfit(self, *arguments), Traced):
            self.check = mask.index

    def _argument(self, k: int, array: Array) -> Any:
        return Rows(self, k) if array.rows else Table(self, k) if array.table else self.argument(k)

    def argument(self, k: int) -> Nested:
        """The scalars of an argument."""
        return self._nested(self.program.arguments[k], "input", k)

    def parameter(self, index: int) -> Parameter:
        """An integer of the call, as the number of turns of a loop."""
        return Parameter(index)

    def record(self, result: int, value: Nested) -> None:
        """Write a row of a result at each turn of the innermost loop."""
        loop = self.graph.loops[self.graph.open - 1]
        nodes = self._nodes(self.program.results[result], value)
        loop.records += [(result, k, node) for k, node in enumerate(nodes)]

    def _nodes(self, array: Array, value: Nested) -> list[int]:
        nodes = [x.index if isinstance(x, Traced) else self.graph.constant(x) for x in flatten(value)]
        assert len(nodes) == array.size, f"{self.program.name}: {array.name} has {len(nodes)} scalars, not {array.size}"
        return nodes

    def _nested(self, array: Array, *node: Any) -> Nested:
        scalars = iter([Traced(self.graph, self.graph.node(*node, k)) for k in range(array.size)])
        return _shaped(array.shape, scalars)


class Table:
    """An argument that all states share, to be looked into; see `scalar.lookup`."""

    def __init__(self, tape: Tape, argument: int):
        self._tape, self._argument = tape, argument

    def __len__(self) -> int:
        return self._tape.program.arguments[self._argument].size

    def entry(self, k: Traced) -> Scalar:
        """Its k-th number."""
        graph = self._tape.graph
        return Traced(graph, graph.node("lookup", self._argument, k.index))


class Rows:
    """An argument that has a row for each turn of a loop."""

    def __init__(self, tape: Tape, argument: int):
        self._tape, self._argument = tape, argument

    def row(self) -> Nested:
        """Its row at this turn of the innermost loop."""
        tape = self._tape
        return tape._nested(tape.program.arguments[self._argument], "row", tape.graph.open, self._argument)


def _shaped(shape: Sequence[int], scalars: Any) -> Nested | Scalar:
    return next(scalars) if not shape else [_shaped(shape[1:], scalars) for _ in range(shape[0])]
