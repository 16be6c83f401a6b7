"""Particles that act on each other: machine code goes where the interpreter does, with the same bits on any registers."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import particles as ap
from articulated.compiler.machine import _levels
from articulated.particles.together import are_laws


def twist(t, points, k):
    a, b = points
    return [(b.x - a.x).cross(a.v) * k, (a.x - b.x).cross(b.v) * k]


def cloth(rows=9, columns=7):
    """With everything at once: springs, bending, wind on triangles, weight, drag, ground, and a law of one's own."""
    rng, n = np.random.default_rng(0), rows * columns
    number = np.arange(n).reshape(rows, columns)
    i, j = np.unravel_index(np.arange(n), (rows, columns))
    x = np.stack([0.1 * i, 0.1 * j, np.full(n, 0.3)], axis=1) + 0.01 * rng.normal(size=(n, 3))
    along, across = (
        np.stack([a.ravel(), b.ravel()], 1) for a, b in ((number[1:], number[:-1]), (number[:, 1:], number[:, :-1]))
    )
    pairs = np.concatenate([along, across])
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]))
    hinges, triangles = np.stack([b, c, a, d], 1), np.concatenate([np.stack([a, b, c], 1), np.stack([d, c, b], 1)])
    forces = [
        ap.Gravity(),
        ap.Springs(pairs, rng.uniform(50.0, 99.0, len(pairs)), 0.05),
        ap.TriangleWind(triangles, 0.2, ap.vortex((0, 0, 0), (0, 0, 1), 3.0)),
        ap.Drag(rng.uniform(0.001, 0.01, n)),
        ap.Bending(np.stack([number[:-2], number[1:-1], number[2:]], -1).reshape(-1, 3), 0.3, 0.01),
        ap.Bending(hinges, 1e-3, 0.0, ap.hinge_weights(x, hinges)),
        ap.OwnLaw(twist, pairs[:5], (0.01,)),
    ]
    things = [ap.Sphere((0.4, 0.3, 0.0), 0.25, 0.2, 0.3), ap.Plane(friction=0.5)]
    return ap.System(x, None, rng.uniform(0.01, 0.02, n), forces, things, pinned=[0, 5])


@pytest.mark.parametrize("solver", ["euler", "semi_implicit"])
def test_compiled_is_as_interpreted(solver, monkeypatch):
    compiled, interpreted = cloth(), cloth()
    assert are_laws(compiled.forces, solver)
    start = compiled.x.copy()
    compiled.step(1e-3, solver, 200)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    interpreted.step(1e-3, solver, 200)
    np.testing.assert_allclose(compiled.state, interpreted.state, atol=1e-11)
    assert np.abs(compiled.x - start).max() > 0.1
    np.testing.assert_array_equal(compiled.x[[0, 5]], start[[0, 5]])


def test_same_bits_for_steps_at_once_and_one_by_one():
    once, by_one = cloth(), cloth()
    once.step(1e-3, steps=20)
    for _ in range(20):
        by_one.step(1e-3)
    assert once.state.tobytes() == by_one.state.tobytes()


@pytest.mark.parametrize("level", list(_levels()))
def test_same_bits_at_every_level_of_vector_instructions(level, monkeypatch):
    best = cloth()
    best.step(1e-3, steps=50)
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    other = cloth()
    other.step(1e-3, steps=50)
    assert other.state.tobytes() == best.state.tobytes()


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 9, 16, 17])
def test_any_number_of_elements(count, monkeypatch):
    """What fills up registers does nothing to anyone."""
    rng = np.random.default_rng(count)
    x, v = rng.normal(size=(count + 1, 3)), rng.normal(size=(count + 1, 3))
    pairs = np.stack([np.arange(count), np.arange(1, count + 1)], axis=1)
    compiled, interpreted = (ap.System(x, v, 1.0, [ap.Springs(pairs, 30.0, 0.1, 0.5)]) for _ in range(2))
    compiled.step(0.01, steps=10)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    interpreted.step(0.01, steps=10)
    np.testing.assert_allclose(compiled.state, interpreted.state, atol=1e-13)


def test_momentum_of_a_blob_through_machine_code(rng):
    n = 200
    pairs = [(i, j) for i in range(n) for j in range(i) if (i * j) % 31 == 1]
    springs = ap.Springs(pairs, 40.0, 0.3, 1.0)
    system = ap.System(rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.uniform(0.5, 2.0, n), [springs])
    p, L = system.momentum()
    scale = np.abs(system.mass[:, None] * system.v).sum()
    system.step(2e-3, steps=2000)
    now = system.momentum()
    np.testing.assert_allclose(now[0], p, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(now[1], L, rtol=0, atol=1e-12 * scale)


def test_nothing_acts_if_there_are_no_elements():
    system = ap.System(np.zeros((2, 3)), [(1.0, 0, 0), (0, 1.0, 0)], 1.0, [ap.Springs(np.zeros((0, 2), int), 1.0)])
    system.step(0.5, steps=2)
    np.testing.assert_array_equal(system.x, [(1.0, 0, 0), (0, 1.0, 0)])
