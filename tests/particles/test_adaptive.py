"""Adaptive steps: order, tolerance, first steps, impacts, and what cannot be solved ends with a word of advice."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from articulated import particles as ap
from articulated.particles.solvers import adaptive
from articulated.simulation import dopri5

G = 9.81


def oscillator(k=60.0, damping=1.1):
    m = 0.7
    return ap.System([(0, 0, 0), (1.3, 0, 0)], None, [1.0, m], [ap.Springs([(0, 1)], k, damping, 1.0)], pinned=[0])


def exact(T, k=60.0, d=1.1, m=0.7):
    rate, turn = 0.5 * d / m, math.sqrt(k / m - (0.5 * d / m) ** 2)
    return 1.0 + 0.3 * math.exp(-rate * T) * (math.cos(turn * T) + rate / turn * math.sin(turn * T))


def orbit():
    """Of an eccentricity of 0.6."""
    pull = ap.Acceleration(ap.attractor((0, 0, 0), 1.0, 1e-3))
    return ap.System([(1.0, 0, 0)], [(0, 0.6, 0.2)], 1.0, [pull])


@pytest.fixture
def tries(monkeypatch):
    """The length of each step that was tried."""
    lengths, stages = [], adaptive._stages
    monkeypatch.setattr(adaptive, "_stages", lambda system, y, k, h: lengths.append(h) or stages(system, y, k, h))
    return lengths


def test_coefficients_are_those_of_rigs():
    assert (adaptive._A[:-1], adaptive._A[-1], adaptive._E) == (dopri5.DOPRI5.a[1:], dopri5.DOPRI5.b, dopri5._ERROR)
    np.testing.assert_allclose([sum(row) for row in adaptive._A], adaptive._C, rtol=1e-14)


def test_order_of_a_step_and_of_its_error():
    """Of a force that changes with time, too."""
    force = ap.OwnLaw(lambda t, points: [points[0].x * (-4.0 - t) - points[0].v])
    errors, estimates = [], []
    for h in (0.1, 0.05):
        system = ap.System([(1.0, 0.5, 0)], [(0, 1.0, 0)], 1.0, [force])
        fine = solve_ivp(system.rhs, (0.0, h), system.state, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        y, k = np.stack([system.x, system.v]), np.empty((7, 2, 1, 3))
        k[0] = adaptive._slope(system, 0.0, y)
        errors.append(np.abs(adaptive._stages(system, y, k, h).ravel() - fine).max())
        estimates.append(h * np.abs(np.tensordot(adaptive._E, k, 1)).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(6.0, abs=0.3)
    assert math.log2(estimates[0] / estimates[1]) == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize("kind", ["oscillator", "orbit"])
def test_errors_follow_the_tolerance(kind, tries):
    T = 2.0 if kind == "oscillator" else 10.0
    fine = solve_ivp(orbit().rhs, (0.0, T), orbit().state, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    errors, counts = [], []
    for tolerance in (1e-5, 1e-7, 1e-9):
        tries.clear()
        system = oscillator() if kind == "oscillator" else orbit()
        system.step(T, ap.Adaptive(tolerance, 1e-3 * tolerance))
        assert system.time == T
        errors.append(abs(system.x[1, 0] - exact(T)) if kind == "oscillator" else np.abs(system.state - fine).max())
        counts.append(len(tries))
    assert errors[0] < 100 * 1e-5 * (1 if kind == "oscillator" else 100)  # errors of an orbit add up
    # a hundredth of the error, for 100^(1/5) times as many steps
    np.testing.assert_allclose(np.log10(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.9)
    np.testing.assert_allclose(np.divide(counts[1:], counts[:-1]), 100**0.2, rtol=0.25)


def test_as_dop853():
    system, T = orbit(), 20.0
    fine = solve_ivp(system.rhs, (0.0, T), system.state, method="DOP853", rtol=1e-13, atol=1e-15)
    system.step(T / 4, ap.Adaptive(1e-12, 1e-14), steps=4)
    np.testing.assert_allclose(system.state, fine.y[:, -1], atol=1e-9)
    assert system.time == T


def test_many_particles_that_act_on_each_other(rng):
    n = 12
    pairs = [(i, j) for i in range(n) for j in range(i) if (i * j) % 3 == 1]
    x, v = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    forces = [ap.Springs(pairs, 40.0, 0.3, 1.0), ap.Gravity(), ap.Drag(0.2, ap.vortex((0, 0, 0), (0, 0, 1), 2.0))]
    system = ap.System(x, v * (np.arange(n) > 0)[:, None], rng.uniform(0.5, 2.0, n), forces, pinned=[0])
    fine = solve_ivp(system.rhs, (0.0, 1.0), system.state, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    system.step(1.0, "adaptive")
    np.testing.assert_allclose(system.state, fine, atol=1e-4)
    np.testing.assert_array_equal(system.x[0], x[0])
    system.time, system.state = 0.0, np.concatenate([x.ravel(), (v * (np.arange(n) > 0)[:, None]).ravel()])
    system.step(1.0, ap.Adaptive(1e-10, 1e-12))
    np.testing.assert_allclose(system.state, fine, atol=1e-8)


def test_first_steps_suit_the_problem(tries):
    """As many steps at every scale of time, and few of them in vain."""
    counts = []
    for k in (1e-4, 1.0, 1e4, 1e8):
        tries.clear()
        pull = ap.OwnLaw(lambda t, points, k: [points[0].x * -k], values=(k,))
        system = ap.System([(1.0, 0, 0)], [(0, math.sqrt(k), 0)], 1.0, [pull])
        system.step(10.0 / math.sqrt(k), ap.Adaptive(1e-6, 1e-12))
        assert system.x[0, 0] == pytest.approx(math.cos(10.0), abs=1e-4)
        counts.append(len(tries))
        assert 5e-4 < tries[0] * math.sqrt(k) < 1.0
    assert max(counts) <= 1.3 * min(counts)


def test_what_rests_does_not_water_down_errors():
    pull = ap.Acceleration(ap.attractor((0, 0, 0), 1.0, 1e-3))
    many = ap.System(
        [(1.0, 0, 0), *[(5.0, 0, 0)] * 99], [(0, 0.6, 0.2), *[(0, 0, 0)] * 99], forces=[pull], pinned=range(1, 100)
    )
    one = orbit()
    for system in (one, many):
        system.step(3.0, "adaptive")
    np.testing.assert_allclose(many.x[0], one.x[0], rtol=1e-12)


def test_few_steps_where_nothing_bends(tries):
    system = ap.System([(0, 0, 50.0)], [(1.0, 0, 20.0)], 1.0, [ap.Gravity()], [ap.Plane()])
    system.step(4.0, "adaptive")
    assert len(tries) < 20
    np.testing.assert_allclose(system.x, [(4.0, 0.0, 50.0 + 80.0 - 8.0 * G)], rtol=1e-12)


def test_a_ball_that_is_thrown_up_comes_down_within_a_step():
    k, speed = 0.8, 5.0
    system = ap.System([(0, 0, 0.0)], [(0, 0, speed)], 1.0, [ap.Gravity()], [ap.Plane(restitution=k)])
    flight = 2.0 * speed / G
    system.step(flight * (1.0 + 0.5 * k), "adaptive")
    assert system.x[0, 2] == pytest.approx((k * speed) ** 2 / (2.0 * G), abs=1e-4)
    system.step(flight * (0.5 * k + k**2 + 0.5 * k**3), "adaptive")
    assert system.x[0, 2] == pytest.approx((k**3 * speed) ** 2 / (2.0 * G), abs=1e-3)
    system.step(10.0, "adaptive")
    assert abs(system.x[0, 2]) < 1e-9
    assert abs(system.v[0, 2]) < 1e-12


def test_bounces_keep_their_height():
    system = ap.System([(0, 0, 1.0)], None, 1.0, [ap.Gravity()], [ap.Plane(restitution=1.0)])
    before = system.energy()
    system.step(10.0, "adaptive")
    assert system.energy() == pytest.approx(before, rel=1e-3)
    better = ap.System([(0, 0, 1.0)], None, 1.0, [ap.Gravity()], [ap.Plane(restitution=1.0)])
    better.step(10.0, ap.Adaptive(sag=1e-7))
    assert better.energy() == pytest.approx(before, rel=1e-5)


def test_sliding_distance():
    mu, speed = 0.35, 3.0
    system = ap.System([(0, 0, 0)], [(speed * 0.6, speed * 0.8, 0)], 1.0, [ap.Gravity()], [ap.Plane(friction=mu)])
    system.step(2.0, "adaptive")
    assert np.linalg.norm(system.x[0]) == pytest.approx(speed**2 / (2 * mu * G), rel=1e-3)
    np.testing.assert_allclose(system.v, 0.0, atol=1e-12)


def test_no_particles():
    nothing = ap.System(np.zeros((0, 3)), forces=[ap.Gravity()], colliders=[ap.Plane()])
    nothing.step(0.1, "adaptive")
    assert nothing.time == 0.1


def singular(t, points):
    (point,) = points
    return [point.v * point.v.dot(point.v)]


@pytest.mark.parametrize(
    ("make", "h", "solver", "message"),
    [
        (
            lambda: ap.System([(0, 0, 0), (1, 0, 0)], None, 1.0, [ap.Springs([(0, 1)], 1e8, 1e5, 0.9)]),
            1.0,
            ap.Adaptive(max_steps=100),
            r"Adaptive: 100 steps came to t = 0.0\d+ s on the way from 0 to 1 s, .* stiff take solver='implicit_euler'",
        ),
        (  # v′ = v³ has no solution after t = 1/2
            lambda: ap.System([(0, 0, 0)], [(1.0, 0, 0)], 1.0, [ap.OwnLaw(singular)]),
            1.0,
            "adaptive",
            r"steps came to t = 0.5 s .* they jump or have no bound",
        ),
        (
            lambda: ap.System([(1, 0, 0), (0, 0, 0)], forces=[ap.Acceleration(lambda t, x: x * (1.0 / x.dot(x)))]),
            0.1,
            "adaptive",
            r"what acts on particle 1 at t = 0 s is not finite",
        ),
    ],
)
def test_what_cannot_be_solved_is_told_and_nothing_is_lost(make, h, solver, message):
    system = make()
    before = system.state
    with pytest.raises(ArithmeticError, match=message), np.errstate(divide="ignore"):
        system.step(h, solver)
    np.testing.assert_array_equal(system.state, before)
    assert system.time == 0.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.Adaptive(rtol=-1.0), r"Adaptive: rtol is -1; expected a number above zero, or zero"),
        (lambda: ap.Adaptive(atol=0.0), r"Adaptive: atol is 0; expected a number above zero"),
        (lambda: ap.Adaptive(sag=np.inf), r"Adaptive: sag is inf; every entry must be finite"),
        (lambda: ap.Adaptive(max_steps=1.5), r"Adaptive: max_steps is 1.5; expected a whole number, 1 or more"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
