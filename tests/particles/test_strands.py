"""Strands in machine code: the same steps as the interpreter takes, which are those of a dense solver."""

from __future__ import annotations

import numpy as np
import pytest
from test_chains import dense, strands

from articulated import particles as ap
from articulated.compiler.machine import _levels
from articulated.scalar import sqrt

H, LINEAR = 5e-3, ap.ImplicitEuler(turns=1)


def twice(make, monkeypatch, steps=3):
    """What machine code makes of a system, and what the interpreter does."""
    one, other = make(), make()
    assert one.step(H, LINEAR, steps) == 0.0
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    other.step(H, LINEAR, steps)
    return one, other


def alike(one, other, within=1e-12):
    np.testing.assert_allclose(one.x, other.x, atol=within, rtol=within)
    np.testing.assert_allclose(one.v, other.v, atol=within * max(1.0, np.abs(other.v).max()) / H)
    assert one.time == pytest.approx(other.time)


@pytest.mark.parametrize(("count", "length"), [(1, 2), (1, 3), (5, 4), (9, 12), (40, 30)])
@pytest.mark.parametrize("bending", [0.0, 0.02])
def test_as_interpreted(count, length, bending, monkeypatch):
    one, other = twice(lambda: strands(count, length, stiffness=1e4, bending=bending), monkeypatch)
    alike(one, other)


def test_a_step_is_that_of_a_dense_solver():
    system, other = strands(3, 9), strands(3, 9)
    system.step(H, LINEAR)
    x = other.x + H * other.v
    A = dense_at(other, x)
    b = H * other.force(H, x, other.v)
    free = np.repeat(other.inverse_mass > 0.0, 3)
    change = np.zeros(A.shape[0])
    change[free] = np.linalg.solve(A[np.ix_(free, free)], b.ravel()[free])
    np.testing.assert_allclose(system.v, other.v + change.reshape(-1, 3), atol=1e-9)
    np.testing.assert_allclose(system.x, other.x + H * system.v, atol=1e-14)


def dense_at(system, x):
    there = ap.System(x, system.v, np.where(system.mass > 0, system.mass, np.inf), system.forces)
    return dense(there, H)


@pytest.mark.parametrize("method", [LINEAR, ap.ImplicitEuler()])
def test_a_strand_that_is_pressed_straight_onto_its_root(method):
    """What the root itself would feel has no inverse."""
    n = 5
    x = np.linspace((0, 0, 0), (0.9, 0, 0), n)
    pairs = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    system = ap.System(x, None, 0.1, [ap.Springs(pairs, 60.0, 0.1, 0.25)], pinned=[0])
    system.step(H, method, 400)
    assert np.abs(system.x[-1] - (1.0, 0.0, 0.0)).max() < 0.05


def test_what_is_irregular(monkeypatch):
    """Springs that some chains have and others lack, told either way round, two between the same particles, held anywhere."""

    def make():
        rng = np.random.default_rng(5)
        x = np.cumsum(rng.normal(size=(4 * 7, 3)), axis=0)
        number = np.arange(28).reshape(4, 7)
        chain = np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)
        some = np.array([(2, 0), (7, 9), (9, 7), (23, 25), (22, 21)])
        forces = [
            ap.Springs(chain, rng.uniform(1, 99, 24), 0.1),
            ap.Springs(some, rng.uniform(1, 99, 5)),
            ap.Drag(rng.uniform(0, 1, 28), wind=(1.0, 2.0, 0.0)),
            ap.Bending(np.stack([number[:2, 1], number[:2, 0], number[:2, 2]], axis=1), 3.0, 0.1, (-2.0, 1.0, 1.0)),
        ]
        return ap.System(x, None, rng.uniform(1, 2, 28), forces, pinned=[3, 14, 27])

    system = make()
    assert system.chains is not None
    one, other = twice(make, monkeypatch)
    alike(one, other, 1e-11)
    assert np.array_equal(one.x[[3, 14, 27]], system.x[[3, 14, 27]])


def test_laws_of_ones_own_and_what_is_in_the_way(monkeypatch):
    def cubic(t, points, k):
        a, b = points
        d = a.x - b.x
        f = d * (-k * d.dot(d)) - d * (0.01 * sqrt(1.0 + t))
        return [f, -f]

    def make():
        hanging = strands(11, 6, stiffness=1e3)
        forces = [*hanging.forces, ap.OwnLaw(cubic, hanging.forces[1].pairs, [1e3])]
        ground = ap.Plane((0.1, 0.0, 1.0), (0.0, 0.0, -0.08), restitution=0.2, friction=0.3)
        colliders = [ground, ap.Sphere((0.4, 0.0, -0.05), 0.04)]
        pinned = np.flatnonzero(hanging.mass == 0.0)
        mass = np.where(hanging.mass > 0.0, hanging.mass, 1.0)
        return ap.System(hanging.x, hanging.v, mass, forces, colliders, pinned)

    one, other = twice(make, monkeypatch, steps=20)
    alike(one, other, 1e-9)
    assert one.colliders[0].gap(0.0, ap.points.vectors(one.x))[0].min() > -1e-9


def test_the_same_bits_for_any_number_of_threads_and_in_any_company():
    results = []
    for threads in (1, 2, 3):
        system = strands(100, 8)
        system.step(H, LINEAR, 5, threads)
        results.append(np.concatenate([system.x, system.v]).tobytes())
    assert len(set(results)) == 1
    few = strands(100, 8)
    some = np.arange(37 * 8, 40 * 8)
    forces = [ap.Gravity(), *(_part(force, some) for force in few.forces[1:])]
    alone = ap.System(few.x[some], few.v[some], np.where(few.mass > 0, few.mass, np.inf)[some], forces)
    alone.step(H, LINEAR, 5)
    few.step(H, LINEAR, 5)
    assert alone.x.tobytes() == few.x[some].tobytes()


def test_the_same_bits_on_any_registers(monkeypatch):
    found = []
    for level in _levels():
        monkeypatch.setenv("ARTICULATED_SIMD", level)
        system = strands(11, 9)
        system.step(H, LINEAR, 5)
        found.append(np.concatenate([system.x, system.v]).tobytes())
    assert len(found) > 1
    assert len(set(found)) == 1


def _part(force, some):
    """A law for some particles, in a row, alone."""
    if isinstance(force, ap.Drag):
        return force
    inside = np.isin(force.particles, some).all(axis=1)
    own = force.particles[inside] - some[0]
    if isinstance(force, ap.Springs):
        return ap.Springs(own, force.stiffness[inside], force.damping, force.rest_length[inside])
    return ap.Bending(own, force.stiffness, force.damping)
