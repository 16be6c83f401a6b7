"""Implicit steps of cloth in machine code: where the interpreter goes, with the same bits on any registers."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import particles as ap
from articulated.compiler.machine import _levels
from articulated.particles.roots import matrix
from articulated.scalar import sqrt

H = 5e-3


def cloth(rows, columns, seed=0, **more):
    made = ap.grid_cloth((0, 0, 1), (1, 0, 0), (0, 1, 0), rows, columns, 0.2, 200.0, bending=1e-3, damping=1e-3)
    x = made.x + 1e-2 * np.random.default_rng(seed).normal(size=made.x.shape)
    wind = ap.TriangleWind(made.triangles, 0.3, lambda t, x: x * 0.5 + ap.Point(x, x, t).x * t)
    forces = [ap.Gravity(), *made.forces, ap.Drag(1e-3, (0.0, 1.0, 0.0)), wind]
    return ap.System(x, None, made.mass, forces, pinned=[0, columns - 1], **more)


def twice(make, monkeypatch, iterations, steps=3):
    one, other = make(), make()
    left = one.step(H, ap.ImplicitEuler(turns=1, iterations=iterations), steps)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    assert other.step(H, ap.ImplicitEuler(turns=1, iterations=iterations), steps) == pytest.approx(left, rel=1e-6, abs=1e-13)
    monkeypatch.delenv("ARTICULATED_INTERPRET")
    np.testing.assert_allclose(one.x, other.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.v, other.v, rtol=0, atol=1e-12 / H)
    assert one.time == pytest.approx(other.time)
    return one, left


@pytest.mark.parametrize("size", [(3, 3), (4, 7), (12, 9)])
@pytest.mark.parametrize("iterations", [5, 40])
def test_as_interpreted(size, iterations, monkeypatch):
    start = cloth(*size)
    system, left = twice(lambda: cloth(*size), monkeypatch, iterations)
    assert 0.0 < left < 1.0
    assert np.array_equal(system.x[[0, size[1] - 1]], start.x[[0, size[1] - 1]])


def test_many_turns_solve_the_system():
    """To the last digits, what a dense solver gives."""
    system, other = cloth(6, 5), cloth(6, 5)
    assert system.step(H, ap.ImplicitEuler(turns=1, iterations=300)) < 1e-9
    there = other.x + H * other.v
    A, b = matrix(other, H, there, other.v, H).toarray(), H * other.force(H, there, other.v).ravel()
    free = np.repeat(other.inverse_mass > 0.0, 3)
    change = np.zeros(len(b))
    change[free] = np.linalg.solve(A[np.ix_(free, free)], b[free])
    np.testing.assert_allclose(system.v, other.v + change.reshape(-1, 3), rtol=0, atol=1e-10)


def test_what_is_solved_stays_so():
    """More turns than it takes make no difference, and no NaN."""
    few, many = cloth(4, 4), cloth(4, 4)
    few.step(H, ap.ImplicitEuler(turns=1, iterations=100))
    many.step(H, ap.ImplicitEuler(turns=1, iterations=2000))
    np.testing.assert_allclose(few.v, many.v, rtol=0, atol=1e-11)
    still = ap.System(np.eye(3), None, 1.0, [ap.Springs([(0, 1), (1, 2), (2, 0)], 10.0)])
    assert still.step(H, ap.ImplicitEuler(turns=1), 3) == 0.0
    np.testing.assert_array_equal(still.x, np.eye(3))


def test_laws_of_ones_own_and_what_is_in_the_way(monkeypatch):
    def law(t, points, k):
        a, b, c = points
        d = a.x + c.x - b.x * 2.0
        f = d * (-k * sqrt(1.0 + d.dot(d)))
        return [f, f * -2.0, f]

    def make():
        system = cloth(7, 6, colliders=[ap.Sphere((0.5, 0.5, 0.85), 0.14, friction=0.3), ap.Plane((0, 0, 1), (0, 0, 0.9))])
        own = ap.OwnLaw(law, [(k, k + 1, k + 6) for k in range(0, 30, 4)], [np.linspace(1.0, 2.0, 8)])
        mass = np.where(system.mass > 0.0, system.mass, 0.01)
        return ap.System(system.x, None, mass, [*system.forces, own], system.colliders, np.flatnonzero(system.mass == 0.0))

    system, _ = twice(make, monkeypatch, 30, steps=40)
    assert system.colliders[0].gap(0.0, ap.points.vectors(system.x))[0].min() > -1e-9


@pytest.mark.parametrize("levels", [sorted(_levels())])
def test_the_same_bits_on_any_registers(levels, monkeypatch):
    found = []
    for level in levels:
        monkeypatch.setenv("ARTICULATED_SIMD", level)
        system = cloth(9, 7)
        system.step(H, ap.ImplicitEuler(turns=1, iterations=25), 4)
        found.append(np.concatenate([system.x, system.v]).tobytes())
    assert len(levels) > 1
    assert len(set(found)) == 1


def test_what_blows_up_is_told_and_forgotten():
    """Numbers that overflow: the state is that which was last seen."""
    system = cloth(4, 4)
    x = system.x.copy()
    system.v = np.where(system.inverse_mass[:, None] > 0.0, 1e200, 0.0)
    with pytest.raises(FloatingPointError, match="no finite place"):
        system.step(H, ap.ImplicitEuler(turns=1), 5)
    np.testing.assert_array_equal(system.x, x)
    assert system.time == 0.0
