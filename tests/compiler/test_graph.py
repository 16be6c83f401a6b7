"""Traced programs: what folds away, what is fused, and loops."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import scalar
from articulated.compiler import Array, Program, Tape, compiled, evaluate
from articulated.compiler.graph import Traced
from articulated.compiler.schedule import schedule


def program(algorithm, narguments: int = 1, nresults: int = 1, name: str = "test") -> Program:
    arguments = tuple(Array(f"a{k}") for k in range(narguments))
    results = tuple(Array(f"r{k}") for k in range(nresults))
    return Program(name, str(id(algorithm)).encode(), arguments, results, lambda tape, *x: algorithm(*x), watched=False)


def operations(algorithm, narguments: int = 2) -> list[str]:
    """Names of the operations that are left of an algorithm."""
    tape = Tape(program(lambda *x: [algorithm(*x)], narguments), False)
    plan = schedule(tape.graph, tape.outputs, None, 8)
    return sorted(node[0] for node in plan.operations())


@pytest.mark.parametrize(
    ("algorithm", "left"),
    [
        (lambda x, y: x * 0.0 + 3.0 * 2.0, []),
        (lambda x, y: x * 1.0 + 0.0, []),
        (lambda x, y: x - x, []),
        (lambda x, y: -(-x), []),
        (lambda x, y: x + (y - x), []),
        (lambda x, y: x * (1.0 / x), []),
        (lambda x, y: (x * 2.0) * 3.0, ["mul"]),
        (lambda x, y: x / 4.0, ["mul"]),
        (lambda x, y: x + (-y), ["sub"]),
        (lambda x, y: (-x) * y - (x * -y), []),
        (lambda x, y: (x * y) + (y * x), ["add", "mul"]),
        (lambda x, y: x * y + x, ["fma"]),
        (lambda x, y: x - x * y, ["fnma"]),
        (lambda x, y: x * y - x, ["fms"]),
        (lambda x, y: (x * y + x) + (x * y + y), ["add", "fma", "fma"]),  # the product itself is not needed
        (lambda x, y: scalar.where(x < y, x, x), []),
        (lambda x, y: scalar.absolute(-x), ["abs"]),
    ],
)
def test_what_folds(algorithm, left):
    assert operations(algorithm) == left


def test_constants_stay_numbers():
    """An algorithm that asks whether something is exactly zero gets an answer."""

    def algorithm(x, y):
        assert scalar.is_zero(x * 0.0)
        assert not isinstance(x * 0.0 + 2.0, Traced)
        return x

    assert operations(algorithm) == []


def test_a_branch_on_a_value_is_refused():
    with pytest.raises(TypeError, match="a traced scalar has no value to branch on"):
        operations(lambda x, y: x if x < y else y)


def collatz(x):
    """Steps of a game with numbers, a different count for each state: halve, or triple and one more, until 1."""

    def turn(carry):
        n, count = carry
        half = 0.5 * n
        whole = (half + 2.0**52) - 2.0**52
        even = scalar.absolute(whole - half) < 0.25
        return [scalar.where(even, half, 3.0 * n + 1.0), count + 1.0]

    n, count = scalar.repeat(1000, turn, [x, 0.0 * x + 0.0], until=lambda carry: carry[0] < 1.5)
    return [n, count]


def nested(x):
    """A loop in a loop: values from outside, swapped values, and one that stays."""

    def outer(carry):
        a, b, c, same = carry
        inner = scalar.repeat(3, lambda d: d * 0.5 + c + same, a)
        return [b, inner, a - b, same]

    return scalar.repeat(5, outer, [x, x + 1.0, 2.0 * x, x * x])


@pytest.mark.parametrize(("algorithm", "nresults"), [(collatz, 2), (nested, 4)])
@pytest.mark.parametrize("lanes", [1, None])
@pytest.mark.parametrize("batch", [1, 7, 8, 45])
def test_loops(algorithm, nresults, lanes, batch):
    x = np.arange(1.0, batch + 1.0)
    expected = np.empty((batch, nresults))
    evaluate(algorithm, [(x, 0)], expected, (batch,))
    results = [np.empty(batch) for _ in range(nresults)]
    kernel = compiled(program(algorithm, 1, nresults, algorithm.__name__), False, lanes)
    kernel([(a, 8, 0, None) for a in (x, *results)], batch, 1)
    np.testing.assert_allclose(np.stack(results, axis=-1), expected, rtol=1e-14)


def test_rows_and_records():
    """One row of an argument, in an order that the call says, and one of a result for each turn; counts come with the call."""

    def write(tape, start, rows):
        def turn(carry):
            tape.record(0, [carry, carry * carry])
            (x,) = rows.row()
            return 2.0 * carry + x

        return [scalar.repeat(tape.parameter(0), turn, start)]

    arguments = (Array("start"), Array("rows", (1,), rows=True))
    results = (Array("record", (2,), rows=True), Array("end"))
    kernel = compiled(Program("rows", b"", arguments, results, write, watched=False), False)
    batch, turns = 11, np.array([3, 0, 0, 2])
    rng = np.random.default_rng(0)
    start, rows = rng.normal(size=batch), rng.normal(size=(batch, 4, 1))
    record, end = np.empty((batch, 4, 2)), np.empty(batch)
    table = [(start, 8, 0, None), (rows, 32, 8, turns), (record, 64, 16, None), (end, 8, 0, None)]
    kernel(table, batch, 1, (4,))
    x = start.copy()
    for k in range(4):
        np.testing.assert_allclose(record[:, k], np.stack([x, x * x], axis=-1), rtol=1e-14)
        x = 2.0 * x + rows[:, turns[k], 0]
    np.testing.assert_allclose(end, x, rtol=1e-14)


def test_large_programs_are_cut_into_chunks():
    """Values that cross from chunk to chunk keep their slots until they are used for the last time."""

    def algorithm(x):
        values = [x * (1.0 + 1e-3 * k) for k in range(50)]
        for k in range(3000):
            values[k % 50] = values[k % 50] * 0.5 + values[(7 * k + 3) % 50]
        return values

    x = np.linspace(-1.0, 1.0, 20)
    expected = np.empty((20, 50))
    evaluate(algorithm, [(x, 0)], expected, (20,))
    result = np.empty((20, 50))
    made = Program("large", b"", (Array("x"),), (Array("r", (50,)),), lambda tape, x: [algorithm(x)], watched=False)
    compiled(made, False)([(x, 8, 0, None), (result, 400, 0, None)], 20, 1)
    np.testing.assert_allclose(result, expected, rtol=1e-13)
