"""Particles that do not act on each other: machine code goes where the interpreter does, with the same bits however it is shared."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import particles as ap
from articulated.compiler.machine import _levels
from articulated.particles.alone import are_alone
from articulated.scalar import atan2, cos, exp, sin, sqrt, where
from articulated.spatial import Vec3

N = 333
COLLIDERS = (
    ap.Plane((0.1, 0, 1), (0, 0, -1.0), 0.6, 0.3),
    ap.Sphere((0.5, 0, 0), 0.4, 0.4, 0.1),
    ap.Capsule([(-1, 0, 0), (-1, 1, 0.3)], 0.2, 0.2, 0.5),
    ap.Box((0, 1, 0), (0.5, 0.4, 0.3), restitution=0.9),
)


def gusts(t, x):
    return Vec3(
        sin(x.z + 3.0 * t),
        cos(x.x) * exp(-x.y * x.y),
        where(x.y > 0.0, sqrt(where(x.y > 0.0, x.y, 0.0) + 0.1), atan2(x.x, 2.0 + x.z)),
    )


def lift(t, points, strength):
    (point,) = points
    return [Vec3(-point.v.y, point.v.x, 0.0) * strength]


def system(seed=0, count=N):
    rng = np.random.default_rng(seed)
    forces = [
        ap.Gravity(),
        ap.Drag(rng.uniform(0.1, 0.6, N)[:count], gusts),
        ap.Acceleration(ap.attractor((0, 0, 0.5), 2.0)),
        ap.OwnLaw(lift, values=(0.3,)),
    ]
    x, mass, pinned = rng.uniform(-2, 2, (N, 3)), rng.uniform(0.5, 2.0, N), np.arange(N) % 17 == 3
    v = np.where(pinned[:, None], 0.0, rng.normal(size=(N, 3)))
    return ap.System(x[:count], v[:count], mass[:count], forces, COLLIDERS, pinned=pinned[:count])


@pytest.mark.parametrize("solver", ["euler", "semi_implicit", "midpoint", "rk4"])
def test_compiled_is_as_interpreted(solver, monkeypatch):
    compiled, interpreted = system(), system()
    assert are_alone(compiled.forces)
    start = compiled.x.copy()
    compiled.step(0.01, solver, 20)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    assert not are_alone(interpreted.forces)
    interpreted.step(0.01, solver, 20)
    np.testing.assert_allclose(compiled.state, interpreted.state, atol=1e-12)
    assert compiled.time == pytest.approx(interpreted.time)
    np.testing.assert_array_equal(compiled.x[compiled.inverse_mass == 0.0], start[compiled.inverse_mass == 0.0])
    assert (np.abs(compiled.x - start).max(axis=1) > 0.05).mean() > 0.9


def test_same_bits_for_any_threads_number_and_place():
    one = system()
    one.step(0.01, steps=30, threads=1)
    for threads in (2, 3, 4):
        other = system()
        other.step(0.01, steps=30, threads=threads)
        assert other.state.tobytes() == one.state.tobytes()
    few = system(count=11)
    few.step(0.01, steps=30)
    assert few.x.tobytes() == one.x[:11].tobytes()


def test_same_bits_for_steps_at_once_and_one_by_one():
    once, by_one = system(), system()
    once.step(0.01, "rk4", 12)
    for _ in range(12):
        by_one.step(0.01, "rk4")
    np.testing.assert_array_equal(once.state, by_one.state)


@pytest.mark.parametrize("level", list(_levels()))
def test_same_bits_at_every_level_of_vector_instructions(level, monkeypatch):
    best = system()
    best.step(0.01, steps=10)
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    other = system()
    other.step(0.01, steps=10)
    assert other.state.tobytes() == best.state.tobytes()


def test_no_particles_and_no_steps():
    nothing = ap.System(np.zeros((0, 3)), forces=[ap.Gravity()])
    nothing.step(0.1, steps=3)
    assert nothing.state.shape == (0,)
    some = system()
    before = some.state
    some.step(0.1, steps=0)
    np.testing.assert_array_equal(some.state, before)
    with pytest.raises(ValueError, match="steps is -1; expected a whole number"):
        some.step(0.1, steps=-1)


def test_what_is_changed_later_is_seen():
    one = ap.System([(0, 0, 1.0)], None, 1.0, [ap.Gravity()])
    one.step(0.01, steps=10)
    one.colliders = (ap.Plane(),)
    one.step(0.01, steps=200)
    assert one.x[0, 2] == pytest.approx(0.0, abs=1e-9)
