"""Systems in float32: near those in float64, whatever takes their steps; the same bits on any registers; things at rest stay."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import particles as ap
from articulated.compiler.machine import _levels

H = 2e-3
FLAT = np.float32


def dust(dtype, **more):
    rng = np.random.default_rng(0)
    x, v = rng.uniform((-1, -1, 0.5), (1, 1, 2.5), (99, 3)), rng.normal(size=(99, 3))
    forces = [ap.Gravity(), ap.Drag(0.3, ap.vortex((0, 0, 0), (0, 0, 1), 3.0))]
    return ap.System(x.astype(dtype), v.astype(dtype), rng.uniform(1, 2, 99).astype(dtype), forces, **more)


def cloth(dtype, **more):
    made = ap.grid_cloth((0, 0, 1), (1, 0, 0), (0, 1, 0), 7, 6, 0.2, 200.0, bending=1e-3, damping=1e-3)
    return ap.System(made.x.astype(dtype), None, made.mass.astype(dtype), [ap.Gravity(), *made.forces], pinned=[0, 5], **more)


def hair(dtype, **more):
    number = np.arange(11 * 6).reshape(11, 6)
    x = np.stack([0.1 * (number % 6), 0.05 * (number // 6), 0.0 * number], axis=-1).reshape(-1, 3)
    pairs = np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)
    forces = [ap.Gravity(), ap.Springs(pairs, 80.0, 0.02)]
    return ap.System(x.astype(dtype), None, 1e-2, forces, pinned=number[:, 0], **more)


LINEAR = ap.ImplicitEuler(turns=1)
WAYS = {
    "alone": (dust, "rk4"),
    "adaptive": (dust, "adaptive"),
    "together": (cloth, "semi_implicit"),
    "in stages": (cloth, "midpoint"),
    "woven": (cloth, LINEAR),
    "position-based": (cloth, "xpbd"),
    "strands": (hair, LINEAR),
    "Newton's method": (hair, "implicit_euler"),
}


@pytest.mark.parametrize("way", WAYS)
def test_near_float64(way):
    make, solver = WAYS[way]
    wide, flat = make(float), make(FLAT)
    start = wide.x.copy()
    for system in (wide, flat):
        system.step(H, solver, 20)
        system.step(H, solver, 20)
    assert (flat.x.dtype, flat.v.dtype, flat.state.dtype) == (FLAT,) * 3
    assert wide.x.dtype == np.float64
    np.testing.assert_allclose(flat.x, wide.x, rtol=0, atol=2e-6)
    np.testing.assert_allclose(flat.v, wide.v, rtol=0, atol=2e-4)
    assert np.abs(flat.x - wide.x).max() > 0.0
    assert np.abs(wide.x - start).max() > 0.01
    assert flat.energy() == pytest.approx(wide.energy(), rel=1e-4)


@pytest.mark.parametrize("way", ["alone", "together", "woven", "strands"])
def test_same_bits_on_any_registers(way, monkeypatch):
    make, solver = WAYS[way]
    found = set()
    for level in _levels():
        monkeypatch.setenv("ARTICULATED_SIMD", level)
        system = make(FLAT)
        system.step(H, solver, 10)
        found.add(system.state.tobytes())
    assert len(_levels()) > 1
    assert len(found) == 1


def test_what_acts_is_told_in_float64():
    """Whoever asks first."""
    flat, wide = cloth(FLAT), cloth(float)
    y = np.random.default_rng(0).normal(size=flat.dimension)
    np.testing.assert_allclose(flat.rhs(0.1, y), wide.rhs(0.1, y), rtol=1e-6, atol=1e-6)
    flat.step(H, "implicit_euler")
    wide.step(H, "implicit_euler")
    np.testing.assert_allclose(flat.x, wide.x, rtol=0, atol=1e-6)


def test_which_arrays_decide():
    x = np.zeros((3, 3), FLAT)
    assert ap.System(x).dtype == FLAT
    assert ap.System(x, x, 2.0).dtype == FLAT
    assert ap.System(x, x.astype(float)).dtype == np.float64
    assert ap.System(x, None, np.ones(3)).dtype == np.float64
    assert ap.System(x.tolist()).dtype == np.float64
    system = ap.System(x)
    system.x = np.ones((3, 3))
    assert system.x.dtype == FLAT


@pytest.mark.parametrize("normal", [(0, 0, 1.0), (0.3, 0.1, 1.0)])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_what_comes_to_rest_far_from_the_origin_stays(normal, restitution, rng):
    n = np.array(normal) / np.linalg.norm(normal)
    x = 3.3 * n + 0.5 * n + np.cross(n, rng.normal(size=(50, 3)))
    ground = ap.Plane(normal, 3.3 * n, restitution, 0.6)
    system = ap.System(x.astype(FLAT), None, 1.0, [ap.Gravity()], [ground])
    system.step(5e-3, steps=1000)
    gaps = system.x.astype(float) @ n - 3.3
    assert np.abs(gaps).max() < 1e-6
    before = system.x.copy()
    system.step(5e-3, steps=400)
    np.testing.assert_array_equal(system.x, before)


def test_runs_are_recorded_in_it():
    run = cloth(FLAT).run(0.1, H, LINEAR, fps=20)
    assert (run.x.dtype, run.v.dtype) == (FLAT, FLAT)
