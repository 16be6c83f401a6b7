"""Work behind branches: bits as if all were computed, in machine code and in C; and that it is skipped."""

from __future__ import annotations

import ctypes
import subprocess

import numpy as np
import pytest

from articulated import scalar
from articulated.compiler import Array, Program, Tape, compiled, evaluate
from articulated.compiler import schedule as scheduling
from articulated.compiler.c_source import definition, prelude
from articulated.compiler.schedule import flattened, schedule

BATCH = 37


def random_program(seed: int, given, n: int = 6):
    """An algorithm that takes n numbers, with branches: some of one mask, some within others, some in loops."""

    def algorithm(x):
        rng = np.random.default_rng(seed)
        values, masks = list(x), []

        def pick():
            return values[rng.integers(len(values))]

        def combined():
            a, b, c = pick(), pick(), pick()
            y = (lambda: a * b + c, lambda: (a - b) * 1.5, lambda: a * 0.75 - b * c)[rng.integers(3)]()
            return y / (0.5 + scalar.absolute(y))

        def mask():
            if not masks or rng.random() < 0.5:
                masks.append(x[0] + pick() > pick())
            return masks[rng.integers(len(masks))]

        def branch(depth: int):
            outside = len(values)
            otherwise = [pick() for _ in range(rng.integers(1, 4))]

            def inside():
                for _ in range(rng.integers(1, 8)):
                    values.append(combined())
                if depth < 2 and rng.random() < 0.4:
                    values.extend(branch(depth + 1))
                result = [scalar.where(pick() > 1.0, 1.0, combined()) for _ in otherwise]
                if rng.random() < 0.7:
                    del values[outside:]  # else others use what a branch has computed
                return result

            return given(mask(), inside, otherwise)

        def looped():
            """A loop that needs what is computed before it, behind a branch only."""
            alone, held = [combined(), combined()], mask()
            alone.append(alone[0] * alone[1] + 0.5)

            def turn(carry):
                return given(held, lambda: [carry[0] * 0.5 + alone[1] * alone[2], carry[1] - alone[0]], carry)

            first, second = scalar.repeat(2, turn, [pick(), pick()])
            return first * 0.75 - second

        def body(carry):
            values[:n], masks[:] = carry, []
            del values[n:]
            state = rng.bit_generator.state
            for _ in range(12):
                values.append(combined())
                values.extend(branch(0))
                values.append(looped())
            rng.bit_generator.state = state  # an interpreter takes each turn anew
            return [values[-k] * 0.5 - values[k] * 0.25 for k in range(1, n)] + [values[0] * 0.5 + 1.0]

        carry = scalar.repeat(3, body, list(x), until=lambda carry: carry[-1] > 1.9)
        return body(carry)

    return algorithm


def both(condition, value, otherwise):
    """What `given` means."""
    return [scalar.where(condition, a, b) for a, b in zip(value(), otherwise, strict=True)]


def as_program(algorithm, n: int = 6, name: str = "branches") -> Program:
    arrays = (Array("x", (n,)),), (Array("r", (n,)),)
    return Program(name, str(id(algorithm)).encode(), *arrays, lambda tape, x: [algorithm(x)], watched=False)


def run(algorithm, x: np.ndarray, lanes: int | None = None) -> np.ndarray:
    result = np.empty_like(x)
    step = x.shape[1] * x.itemsize
    compiled(as_program(algorithm), False, lanes)([(x, step, 0, None), (result, step, 0, None)], len(x), 1)
    return result


@pytest.fixture(params=[1000, 17])
def chunk(request, monkeypatch):
    """Programs in chunks of so many operations."""
    monkeypatch.setenv("ARTICULATED_CACHE", "off")
    monkeypatch.setattr(scheduling.schedule, "__defaults__", ((), request.param))
    return request.param


@pytest.mark.parametrize("lanes", [1, None])
@pytest.mark.parametrize("seed", range(16))
def test_same_bits_as_without_branches(seed, lanes, chunk, rng):
    x = rng.normal(size=(BATCH, 6))
    expected = run(random_program(seed, both), x, lanes)
    assert run(random_program(seed, scalar.given), x, lanes).tobytes() == expected.tobytes()
    interpreted = np.empty_like(x)
    evaluate(random_program(seed, scalar.given), [(x, 1)], interpreted, (BATCH,))
    np.testing.assert_allclose(interpreted, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_same_bits_in_c(seed, chunk, tmp_path, rng):
    x = rng.normal(size=(BATCH, 6))
    expected = run(random_program(seed, both), x)
    source = prelude(False) + definition(as_program(random_program(seed, scalar.given)), "art", False)
    (tmp_path / "it.c").write_text(source)
    library = tmp_path / "it.so"
    subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", "-Wno-maybe-uninitialized", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-o", library, "it.c"],
                   cwd=tmp_path, check=True)  # fmt: skip
    function = ctypes.CDLL(str(library)).art_branches
    result = np.empty_like(x)
    for a, b in zip(x, result, strict=True):
        function(*(ctypes.c_void_p(array.ctypes.data) for array in (a, b)))
    assert result.tobytes() == expected.tobytes()


def test_what_a_mask_alone_needs_is_behind_it():
    def algorithm(x):
        a, b, c = x
        shared = a * b
        first, second = scalar.given(a > 0.0, lambda: [shared * c + 1.0, scalar.sqrt(c)], [0.0, b])
        third = scalar.given(a > 0.0, lambda: scalar.sqrt(c) * first, second)
        return [shared * first, second, third]

    tape = Tape(as_program(algorithm, 3), False)
    plan = schedule(tape.graph, tape.outputs, None, 8)
    behind = sorted(plan.nodes[i][0] for i in plan.guards)
    assert behind == ["fma", "mul", "sqrt"]  # the root in both branches of one mask; the product not, as others need it


def test_states_that_need_it_not_do_not_wait():
    """Chunks are what takes time: what is behind a branch is in machine code behind a jump."""

    def algorithm(x):
        value = x[0]
        for _ in range(10_000):
            value = value * 0.999 + 0.5
        return [scalar.given(x[1] > 0.0, lambda: value, x[0]), x[1]]

    tape = Tape(as_program(algorithm, 2), False)
    plan = schedule(tape.graph, tape.outputs, None, 8)
    computed = [i for item in flattened(plan.items) for i in getattr(item, "nodes", ())]
    assert sum(i in plan.guards for i in computed) == 10_000
    assert sum(i not in plan.guards for i in computed) == 2
