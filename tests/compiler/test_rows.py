"""Loops over rows: in machine code as interpreted; and what is skipped."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from articulated import scalar
from articulated.compiler import Array, Program, Tape, compiled, evaluate
from articulated.compiler.listing import wanted
from articulated.compiler.machine import _levels
from articulated.compiler.schedule import flattened, schedule
from articulated.dynamics.calls import states

BATCH, WIDTH = 21, 24


def random_program(seed):
    """Loops over rows of what there is, of numbers, of what other loops made, and within loops; with branches, and sums."""

    def algorithm(x):
        rng = np.random.default_rng(seed)
        values = list(x)

        def pick():
            return values[rng.integers(len(values))]

        def row(width):
            return [pick() for _ in range(width)]

        def rows(count, width):
            return [row(width) for _ in range(count)]

        def made(some, depth=0):
            outside, width = pick(), int(rng.integers(1, 4))
            pairs = rng.integers(0, len(some[0]), size=(width, 2))
            acts, low = int(rng.integers(0, len(some[0]))), float(rng.normal())

            def body(row):
                def inside():
                    return [scalar.sin(row[a] * row[b] + outside) for a, b in pairs]

                return [*scalar.given(row[acts] > low, inside, [0.5] * width), row[acts] * 0.75]

            return scalar.each(some, body)

        def looped(some):
            start = [x for numbers in made(some) for x in numbers]

            def turn(carry):
                k, held = carry
                some = [held[n : n + 2] for n in range(0, len(held) - 1, 2)]
                new = scalar.each(some, lambda pair: [pair[0] * 0.5 + pair[1] * k, pair[1] - pair[0] * 0.25])
                rest = held[2 * len(some) :]
                return [k * 0.5, [*(x for pair in new for x in pair), *rest]]

            return scalar.repeat(3, turn, [pick(), start], lambda carry: carry[1][0] > 2.0)[1]

        def add(sums, row):
            return scalar.given(row[0] > 0.1, lambda: [sums[0] + row[0] * row[-1]], sums)

        for _ in range(4):
            some = made(
                [[*row, *rng.normal(size=2).tolist()] for row in rows(int(rng.integers(2, 6)), int(rng.integers(1, 3)))]
            )
            again = made(some)
            total = scalar.fold(again, add, [pick()])
            values += [x for numbers in (*some, *again) for x in numbers] + total
            values += looped(rows(3, 3))
        return [values[k] for k in rng.integers(0, len(values), WIDTH)]

    return algorithm


def run(algorithm, x, name):
    content = f"{name} of {inspect.getsource(random_program)}".encode()
    program = Program("rows", content, (Array("x", x.shape[1:]),), (Array("y", (WIDTH,)),), lambda _, x: [algorithm(x)])
    y = np.empty((len(x), WIDTH), x.dtype)
    batch = (len(x),)
    compiled(program, x.dtype == np.float32, None)([states(x, batch, 1), states(y, batch, 1)], len(x), 1)
    return y


@pytest.mark.parametrize("seed", range(8))
def test_machine_code_does_what_is_written(seed):
    x = np.random.default_rng(seed).normal(size=(BATCH, 9))
    expected = np.empty((BATCH, WIDTH))
    evaluate(random_program(seed), [(x, 1)], expected, (BATCH,))
    assert len(np.unique(expected)) > BATCH * WIDTH // 4
    np.testing.assert_allclose(run(random_program(seed), x, f"{seed}"), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_rows_of_arrays_are_rows_of_floats(seed):
    x = np.random.default_rng(seed).normal(size=(BATCH, 9))
    results = np.empty((BATCH, WIDTH))
    evaluate(random_program(seed), [(x, 1)], results, (BATCH,))
    for row, state in zip(results, x, strict=True):
        np.testing.assert_allclose(row, random_program(seed)(state.tolist()), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("level", list(_levels()))
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_every_level_of_vector_instructions(level, dtype, monkeypatch):
    x = np.random.default_rng(0).normal(size=(BATCH, 9)).astype(dtype)
    expected = run(random_program(0), x, "best")
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    assert run(random_program(0), x, level).tobytes() == expected.tobytes()


def test_each_state_alone():
    algorithm = random_program(3)
    x = np.random.default_rng(3).normal(size=(BATCH, 9))
    together = run(algorithm, x, "alone")
    for k in (0, 7, 20):
        assert run(algorithm, x[k : k + 1], "alone").tobytes() == together[k].tobytes()


def test_a_body_is_written_once():
    """However many rows there are."""

    def operations(count):
        def algorithm(x):
            rows = [[x[k], x[k + 1], float(k)] for k in range(count)]
            return [sum((y for (y,) in scalar.each(rows, lambda row: [scalar.sin(row[0] * row[1]) * row[2]])), 0.0)]

        array = Array("x", (count + 1,))
        tape = Tape(Program("once", b"", (array,), (Array("y", (1,)),), lambda _, x: [algorithm(x)]), False)
        chunks = flattened(schedule(tape.graph, tape.outputs, None, 8).items)
        return sum(len(item.nodes) for item in chunks if hasattr(item, "nodes"))

    assert operations(40) - operations(10) == 30  # the sums


def test_what_is_undefined_is_not_written():
    """Where no state of a group needs it: what was there before stays."""

    def algorithm(x):
        rows = [[x[0], 1.0], [x[1], 2.0]]
        made = scalar.each(rows, lambda row: scalar.given(row[0] > 0.0, lambda: [row[0] * row[1]], [scalar.UNDEFINED]))
        return [scalar.where(x[k] > 0.0, made[k][0], -1.0) for k in range(2)] + [0.0] * (WIDTH - 2)

    x = np.array([[1.0, -1.0], [-2.0, -3.0], [3.0, -1.0]])
    assert run(algorithm, x, "undefined")[:, :2].tolist() == [[1.0, -1.0], [-1.0, -1.0], [3.0, -1.0]]


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_rows_that_need_nothing_are_passed_over(share):
    """Several loops over the same rows, on their own and inside another loop, share one list of those that matter."""
    count = 12

    def algorithm(x):
        needed = scalar.each([[x[k], x[count + k]] for k in range(count)], lambda row: [scalar.where(row[0] < share, 1.0, 0.0)])
        rows = [[near, x[count + k]] for k, (near,) in enumerate(needed)]

        def sine(row):
            return scalar.given(row[0] > 0.5, lambda: [scalar.sin(row[1])], [scalar.UNDEFINED])

        def add(total, row):
            return scalar.given(row[0] > 0.5, lambda: [total[0] + row[2]], total)

        def turn(total):
            made = [[*row, y] for row, (y,) in zip(rows, scalar.each(rows, sine), strict=True)]
            return scalar.fold(made, add, [0.5 * total[0]])

        first = turn([0.0])
        return [*first, *scalar.repeat(3, turn, first), *[0.0] * (WIDTH - 2)]

    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(0.01, 0.99, size=(BATCH, count)), rng.normal(size=(BATCH, count))], axis=1)
    expected = np.empty((BATCH, WIDTH))
    evaluate(algorithm, [(x, 1)], expected, (BATCH,))
    np.testing.assert_allclose(run(algorithm, x, f"listed {share}"), expected, rtol=1e-12, atol=1e-12)
    total = np.where(x[:, :count] < share, np.sin(x[:, count:]), 0.0).sum(axis=1)
    np.testing.assert_allclose(expected[:, 1], total * 1.875, rtol=1e-12, atol=1e-12)
    tape = Tape(
        Program("listed", b"", (Array("x", (2 * count,)),), (Array("y", (WIDTH,)),), lambda _, x: [algorithm(x)]), False
    )
    plan = schedule(tape.graph, tape.outputs, None, 8)
    assert [len(rows.numbers) for rows in wanted(plan.items, plan)] == [count] * 4
    assert len(set(wanted(plan.items, plan))) == 1
