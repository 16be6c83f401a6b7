"""The compiler's own sin, cos, roots, exp, log and atan2 against mpmath, and what they do with numbers that are none."""

from __future__ import annotations

import math
from functools import cache

import mpmath as mp
import numpy as np
import pytest

from articulated import scalar
from articulated.compiler import Array, Kernel, Program, compiled

mp.mp.prec = 200


@cache
def kernel(name: str, single: bool = False, lanes: int | None = None) -> Kernel:
    arguments = (Array("y"), Array("x")) if name == "atan2" else (Array("x"),)
    program = Program(name, b"", arguments, (Array("result"),), lambda tape, *x: [getattr(scalar, name)(*x)], watched=False)
    return compiled(program, single, lanes)


def run(name: str, *x: np.ndarray, lanes: int | None = None) -> np.ndarray:
    x = tuple(np.ascontiguousarray(a) for a in x)
    result = np.empty_like(x[0])
    step = result.itemsize
    kernel(name, result.dtype == np.float32, lanes)([(a, step, 0, None) for a in (*x, result)], result.size, 1)
    return result


def ulps(result: np.ndarray, exact: list) -> np.ndarray:
    """Distance in units of the last place of the exact result."""
    return np.array(
        [float(abs(mp.mpf(float(r)) - e) / float(np.spacing(r.dtype.type(abs(e))))) for r, e in zip(result, exact, strict=True)]
    )


def near_multiples_of_a_right_angle(limit: float) -> np.ndarray:
    """The floats next to k π/2 for which the least is left: where a reduction that is not exact enough shows."""
    k = np.arange(1, int(limit / (math.pi / 2)))
    nearest = np.array([float(n * (mp.pi / 2)) for n in k])
    left = np.array([float(abs(mp.mpf(x) - n * (mp.pi / 2))) for x, n in zip(nearest, k, strict=True)])
    return nearest[np.argsort(left)[:2000]]


@pytest.fixture(scope="module")
def worst_points():
    return near_multiples_of_a_right_angle(1e5)


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sin_and_cos_at_the_worst_points(name, worst_points):
    x = np.concatenate([worst_points, -worst_points, np.nextafter(worst_points, 0), worst_points / 2, [0.0, 5e-324, 1e-300]])
    exact = [getattr(mp, name)(mp.mpf(v)) for v in x]
    assert ulps(run(name, x), exact).max() <= 2.0


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sin_and_cos_at_random_points(name, rng):
    """1e6 points against numpy's, which is good to an ulp itself; those that differ most against mpmath."""
    x = np.concatenate([rng.uniform(-1e5, 1e5, 500_000), rng.uniform(-10, 10, 400_000), 10.0 ** rng.uniform(-300, 5, 100_000)])
    result, known = run(name, x), getattr(np, name)(x)
    suspects = np.argsort(np.abs(result - known) / np.spacing(np.abs(known)))[-3000:]
    exact = [getattr(mp, name)(mp.mpf(v)) for v in x[suspects]]
    assert ulps(result[suspects], exact).max() <= 2.0
    assert (np.abs(result - known) <= 4.0 * np.spacing(np.abs(known))).all()


@pytest.mark.parametrize(
    ("name", "low", "high"), [("exp", -700, 700), ("exp", -1, 1), ("log", 1e-300, 1e300), ("log", 0.5, 2), ("sqrt", 0, 1e9)]
)
def test_functions_of_one_argument(name, low, high, rng):
    x = rng.uniform(low, high, 5000) if high < 1e200 else 10.0 ** rng.uniform(-300, 300, 5000)
    exact = [getattr(mp, name)(mp.mpf(v)) for v in x]
    assert ulps(run(name, x), exact).max() <= (0.5 if name == "sqrt" else 3.0)


def test_atan2(rng):
    x, y = rng.normal(size=(2, 5000)) * 10.0 ** rng.integers(-3, 4, (2, 5000))
    assert ulps(run("atan2", y, x), [mp.atan2(mp.mpf(a), mp.mpf(b)) for a, b in zip(y, x, strict=True)]).max() <= 3.0
    corners = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    y, x = (a.ravel() for a in np.meshgrid(corners, corners))
    np.testing.assert_allclose(run("atan2", y, x), np.arctan2(y, x), rtol=3e-16)


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log", "sqrt"])
def test_single_precision(name, rng):
    x = rng.uniform(0.01, 80.0, 20_000).astype(np.float32)
    x = x if name in ("log", "sqrt", "exp") else (x - 40) * 25
    exact = getattr(np, name)(x.astype(np.float64))
    error = np.abs(run(name, x) - exact) / np.spacing(np.abs(exact).astype(np.float32))
    assert error.max() <= 3.0


def test_single_precision_atan2(rng):
    y, x = rng.normal(size=(2, 20_000)).astype(np.float32)
    exact = np.arctan2(y.astype(float), x.astype(float))
    assert (np.abs(run("atan2", y, x) - exact) / np.spacing(np.abs(exact).astype(np.float32))).max() <= 3.0


def test_outside_the_domain():
    inf, nan = np.inf, np.nan
    for name, x, expected in (
        ("sin", [inf, -inf, nan], [nan] * 3),
        ("cos", [inf, -inf, nan], [nan] * 3),
        ("exp", [inf, -inf, nan, 710, -750], [inf, 0, nan, inf, 0]),
        ("log", [inf, 0, -1, nan], [inf, -inf, nan, nan]),
        ("sqrt", [inf, 0, -1, nan], [inf, 0, nan, nan]),
    ):
        np.testing.assert_array_equal(run(name, np.array(x, dtype=float)), expected)


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log", "sqrt"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_a_bad_lane_leaves_the_others_untouched(name, bad, rng):
    x = rng.uniform(0.1, 5.0, 16)
    clean = run(name, x)
    for lane in range(16):
        spoilt = x.copy()
        spoilt[lane] = bad
        others = np.arange(16) != lane
        assert run(name, spoilt)[others].tobytes() == clean[others].tobytes()
