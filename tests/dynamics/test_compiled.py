"""Compiled results are those of the same algorithms interpreted on numpy: every function, both formats."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROBOTS
from random_trees import random_rig
from test_crosscheck import REFUSED

import articulated as art
from articulated.dynamics.functions import programs

TOLERANCE = {np.float64: 1e-13, np.float32: 1e-4}
SWEPT = ("forward_dynamics", "inverse_dynamics", "mass_matrix", "momentum")


def worst(rig: art.Rig, functions, dtype=np.float64, count: int = 9) -> dict[str, float]:
    """For each function the largest difference between compiled and interpreted, relative and over what is allowed.

    Accelerations may differ by what a mass matrix of condition above 1e5 (in float32: 1e2) amplifies.
    """
    rng = np.random.default_rng(0)
    q, q1, v = rig.random(rng, count), rig.random(rng, count), rng.normal(size=(count, rig.nv))
    given = {"q": q, "q0": q, "q1": q1, "v": v, "tau": v[::-1], "a": v[::-1], "dv": v}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ARTICULATED_INTERPRET", "1")
        M = art.mass_matrix(rig, q)
        condition = np.array([np.linalg.cond(m) if rig.nv else 1.0 for m in M])
    result = {}
    for name in functions:
        program = programs(rig).get(name)
        if program is None:
            continue
        arguments = [given[a.name].astype(dtype) for a in program.arguments]
        compiled = getattr(art, name)(rig, *arguments)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("ARTICULATED_INTERPRET", "1")
            # float32 is held against float64: two roundings would say little about either
            reference = getattr(art, name)(rig, *(a.astype(np.float64) for a in arguments))
        scale = 1.0 + np.abs(reference).reshape(count, -1).max(axis=-1, initial=0.0)
        error = np.abs(compiled - reference).reshape(count, -1).max(axis=-1, initial=0.0) / scale
        if name == "forward_dynamics":
            error = error / np.maximum(1.0, condition / (1e5 if dtype == np.float64 else 1e2))
        result[name] = float(error.max() / TOLERANCE[dtype])
    return result


def assert_equal(rig: art.Rig, functions=None, dtype=np.float64) -> None:
    differences = worst(rig, functions or programs(rig), dtype)
    assert not {name: x for name, x in differences.items() if not x <= 1.0}


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("seed", range(6))
def test_random_trees(seed, dtype):
    assert_equal(random_rig(seed, mimic=seed % 2 == 0, armature=seed % 3 == 0, size=8), dtype=dtype)


@pytest.mark.parametrize("name", art.shipped_rigs())
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_shipped_rigs(name, dtype):
    assert_equal(art.load(name, "free"), dtype=dtype)


@pytest.mark.sweep
@pytest.mark.parametrize("robot", [robot for robot in ROBOTS if robot not in REFUSED])
def test_example_robots(robots, robot):
    for root in ("fixed", "free"):
        assert_equal(art.load(robots / robot, root), SWEPT)


@pytest.mark.sweep
@pytest.mark.parametrize("block", range(10))
def test_many_random_trees(block):
    for seed in range(15 * block, 15 * block + 15):
        assert_equal(random_rig(seed), ("forward_dynamics", "inverse_dynamics"))
