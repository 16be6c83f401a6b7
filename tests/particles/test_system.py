"""Particle systems: phase space, closed forms of flight and oscillation, what is conserved, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from articulated import particles as ap

G = 9.81
ORDERS = {"euler": 1, "semi_implicit": 1, "midpoint": 2, "rk4": 4}


def after(system, duration, steps, solver):
    for _ in range(steps):
        system.step(duration / steps, solver)
    return system


def blob(rng, n=20, **more):
    pairs = [(i, j) for i in range(n) for j in range(i) if (i * j) % 3 == 1]
    x, v, mass = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.uniform(0.5, 2.0, n)
    return ap.System(x, v, mass, [ap.Springs(pairs, 40.0, 0.3, rng.uniform(0.5, 1.5, len(pairs)))], **more)


class TestPhaseSpace:
    def test_state_is_all_positions_then_all_velocities(self, rng):
        system = blob(rng)
        assert system.dimension == 120
        y = rng.normal(size=120)
        system.state = y
        np.testing.assert_array_equal(system.state, y)
        np.testing.assert_array_equal(system.x, y[:60].reshape(20, 3))
        y[0] = 9.0
        assert system.state[0] != 9.0  # it keeps its own

    def test_derivative_is_velocity_and_force_over_mass(self, rng):
        system = blob(rng)
        system = ap.System(system.x, system.v * (np.arange(20) != 3)[:, None], system.mass, system.forces, pinned=[3])
        dy = system.derivative()
        np.testing.assert_array_equal(dy[:60], system.v.ravel())
        np.testing.assert_allclose(dy[60:].reshape(20, 3), system.force() * system.inverse_mass[:, None])
        assert not dy[60:].reshape(20, 3)[3].any()
        np.testing.assert_array_equal(dy, system.rhs(0.0, system.state))

    def test_solve_ivp_goes_where_steps_go(self, rng):
        system = blob(rng)
        solution = solve_ivp(system.rhs, (0.0, 0.5), system.state, rtol=1e-10, atol=1e-12)
        after(system, 0.5, 400, "rk4")
        np.testing.assert_allclose(system.state, solution.y[:, -1], atol=1e-6)

    def test_hits_are_events(self):
        system = ap.System(
            [(0, 0, 1.0), (0, 0, 3.0)], [(1.0, 0, 0), (0, 0, 0)], 1.0, [ap.Gravity()], [ap.Plane(restitution=0.5)]
        )
        first = solve_ivp(system.rhs, (0.0, 9.0), system.state, events=system.events(), rtol=1e-10, atol=1e-12)
        assert first.t[-1] == pytest.approx(math.sqrt(2.0 / G), rel=1e-8)
        bounced = system.bounced(first.t[-1], first.y[:, -1])
        speed = math.sqrt(2.0 * G)
        np.testing.assert_allclose(bounced[6:9], (1.0, 0.0, 0.5 * speed), atol=1e-6)
        np.testing.assert_array_equal(bounced[9:], first.y[9:, -1])
        again = solve_ivp(system.rhs, (first.t[-1], 9.0), bounced, events=system.events(), rtol=1e-10, atol=1e-12)
        assert again.t[-1] == pytest.approx(math.sqrt(6.0 / G), rel=1e-8)


class TestClosedForms:
    @pytest.mark.parametrize("solver", ORDERS)
    def test_flight_with_drag_and_wind(self, solver):
        k, m, wind, v0, T = 0.8, 0.5, np.array([3.0, -1.0, 0.5]), np.array([1.0, 2.0, 9.0]), 1.5
        terminal, rate = wind + np.array([0.0, 0.0, -G]) * (m / k), k / m
        decay = math.exp(-rate * T)
        exact = terminal * T + (v0 - terminal) * (1.0 - decay) / rate
        errors = []
        for steps in (40, 80):
            system = ap.System(np.zeros((1, 3)), v0[None], m, [ap.Gravity(), ap.Drag(k, wind)])
            errors.append(np.linalg.norm(after(system, T, steps, solver).x[0] - exact))
        assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[solver], abs=0.15)

    @pytest.mark.parametrize("solver", ORDERS)
    def test_damped_oscillator(self, solver):
        m, k, d, T = 0.7, 60.0, 1.1, 1.0
        system = lambda: ap.System(  # noqa: E731
            [(0, 0, 0), (1.3, 0, 0)], None, [1.0, m], [ap.Springs([(0, 1)], k, d, 1.0)], pinned=[0]
        )
        rate, turn = 0.5 * d / m, math.sqrt(k / m - (0.5 * d / m) ** 2)
        exact = 1.0 + 0.3 * math.exp(-rate * T) * (math.cos(turn * T) + rate / turn * math.sin(turn * T))
        speed = -0.3 * math.exp(-rate * T) * (turn + rate * rate / turn) * math.sin(turn * T)
        errors = []
        for steps in (200, 400):
            done = after(system(), T, steps, solver)
            errors.append(math.hypot(done.x[1, 0] - exact, (done.v[1, 0] - speed) / turn))
        assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[solver], abs=0.25)

    def test_terminal_velocity(self):
        system = ap.System(np.zeros((1, 3)), None, 2.0, [ap.Gravity(), ap.Drag(4.0)])
        after(system, 20.0, 2000, "midpoint")
        np.testing.assert_allclose(system.v[0], (0.0, 0.0, -2.0 * G / 4.0), atol=1e-12)

    def test_circle_becomes_a_spiral_for_euler_and_not_for_the_others(self):
        turn = ap.Acceleration(lambda t, x: x * -1.0)
        radius = {}
        for solver in ORDERS:
            system = after(ap.System([(1.0, 0, 0)], [(0, 1.0, 0)], 1.0, [turn]), 2 * math.pi, 100, solver)
            radius[solver] = np.linalg.norm(system.x[0])
        h = 2 * math.pi / 100
        assert radius["euler"] == pytest.approx((1.0 + h * h) ** 50, rel=1e-9)
        assert radius["rk4"] == pytest.approx(1.0, abs=1e-6)
        assert radius["semi_implicit"] == pytest.approx(1.0, abs=0.05)

    def test_euler_has_its_stability_limit(self):
        """Of v' = −k v: h k = 2."""
        for k, grows in ((1.9, False), (2.1, True)):
            system = after(ap.System(np.zeros((1, 3)), [(1.0, 0, 0)], 1.0, [ap.Drag(k)]), 60.0, 60, "euler")
            assert (abs(system.v[0, 0]) > 1.0) == grows


class TestWhatIsKept:
    @pytest.mark.parametrize("solver", ["semi_implicit", "midpoint", "rk4"])
    def test_momentum_of_a_blob(self, rng, solver):
        system = blob(rng)
        p, L = system.momentum()
        after(system, 2.0, 1000, solver)
        now = system.momentum()
        np.testing.assert_allclose(now[0], p, rtol=0, atol=1e-12 * 20)
        if solver == "semi_implicit":  # the others keep it to their order
            np.testing.assert_allclose(now[1], L, rtol=0, atol=1e-12 * 100)

    def test_energy_of_springs_without_damping(self, rng):
        pairs = [(i, i + 1) for i in range(9)]
        system = ap.System(rng.normal(size=(10, 3)), None, 1.0, [ap.Springs(pairs, 50.0, 0.0, 1.0), ap.Gravity()])
        before = system.energy()
        after(system, 1.0, 2000, "rk4")
        assert system.energy() == pytest.approx(before, rel=1e-8)

    def test_what_is_pinned_stays(self, rng):
        for how in (
            {"pinned": [0, 5]},
            {"pinned": np.arange(10) % 5 == 0},
            {"mass": np.where(np.arange(10) % 5 == 0, np.inf, 1.0)},
        ):
            pairs = [(i, i + 1) for i in range(9)]
            x = rng.normal(size=(10, 3))
            forces, ground = [ap.Springs(pairs, 50.0), ap.Gravity()], [ap.Plane(point=(0, 0, 5.0))]
            system = after(ap.System(x, None, forces=forces, colliders=ground, **how), 0.1, 10, "semi_implicit")
            np.testing.assert_array_equal(system.x[[0, 5]], x[[0, 5]])
            assert (system.x[[1, 2, 3]] != x[[1, 2, 3]]).any()


@pytest.mark.parametrize("solver", ORDERS)
@pytest.mark.parametrize("how", ["compiled", "interpreted", "between two"])
def test_what_blows_up_is_told_and_nothing_is_lost(solver, how, monkeypatch):
    if how == "interpreted":
        monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    x, v = np.array([(0.0, 0, 0), (1.0, 0, 0)]), np.array([(0.0, 0, 0), (0.5, 0.1, 0)])
    stiff = ap.Springs([(0, 1)], 1e6, 0.0, 0.9) if how == "between two" else ap.Drag([0.0, 1e6])
    system = ap.System(x, v, 1.0, [ap.Gravity(), stiff], time=2.0)
    told = rf"[12] of 2 particles, the first of them [01], have no .* after 400 steps of 0.1 s by '{solver}' from t = 2 s; the system"
    with pytest.raises(FloatingPointError, match=told + r" is as it was then: take shorter steps, or solver='implicit_euler'"):
        system.step(0.1, solver, 400)
    np.testing.assert_array_equal(system.state, np.concatenate([x.ravel(), v.ravel()]))
    assert system.time == 2.0
    system.step(0.1, "implicit_euler", 4)  # it goes on from there
    assert system.time == pytest.approx(2.4)


def test_what_a_force_raises_loses_nothing():
    def late(t, x, v, mass):
        if t > 0.25:
            raise KeyError("no wind after that")
        return np.zeros_like(x)

    system = ap.System([(0, 0, 0)], [(1.0, 0, 0)], forces=[ap.OwnForce(late)])
    with pytest.raises(KeyError):
        system.step(0.1, "rk4", 5)
    assert system.time == 0.0
    np.testing.assert_array_equal(system.x, [(0, 0, 0)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.System(np.zeros(3)), r"x has shape \(3,\); expected \(n, 3\)"),
        (lambda: ap.System([(0, 0, np.nan)]), r"x\[0, 2\] is nan; every entry must be finite"),
        (lambda: ap.System(np.zeros((2, 3)), np.zeros((3, 3))), r"v has shape \(3, 3\); expected \(2, 3\)"),
        (lambda: ap.System(np.zeros((2, 3)), None, [1.0, 0.0]), r"mass\[1\] is 0; expected more than zero, or infinity"),
        (lambda: ap.System(np.zeros((2, 3)), None, -1.0), r"mass\[0\] is -1; expected more than zero"),
        (lambda: ap.System(np.zeros((2, 3)), None, [1.0, 2.0, 3.0]), r"mass has shape \(3,\); expected \(2,\)"),
        (
            lambda: ap.System(np.zeros((2, 3)), np.ones((2, 3)), pinned=[1]),
            r"v\[1\] is .*, but particle 1 is pinned; give it no",
        ),
        (lambda: ap.System(np.zeros((2, 3)), pinned=[2]), r"pinned\[0, 0\] is 2; there are 2 particles, the last is 1"),
        (lambda: ap.System(np.zeros((2, 3)), pinned=[True]), r"pinned is a mask of shape \(1,\); expected \(2,\)"),
        (lambda: ap.System(np.zeros((2, 3)), forces=[(0, 0, -9.81)]), r"forces holds \(0, 0, -9.81\); expected Gravity\(\)"),
        (lambda: ap.System(np.zeros((2, 3)), colliders=[ap.Gravity()]), r"colliders holds Gravity.*; expected Plane"),
        (lambda: ap.System(np.zeros((2, 3)), forces=[ap.Springs([(0, 5)], 1.0)]), r"pairs\[0, 1\] is 5; there are 2 particles"),
        (lambda: ap.System(np.zeros((2, 3))).step(0.0), r"h is 0; expected a number above zero"),
        (
            lambda: ap.System(np.zeros((2, 3))).step(0.1, "rk5"),
            r"solver is 'rk5'; expected one of euler, semi_implicit, midpoint, rk4, implicit_euler, adaptive, xpbd, or one of ImplicitEuler",
        ),
        (lambda: setattr(ap.System(np.zeros((2, 3))), "state", np.zeros(6)), r"state has shape \(6,\); expected \(12,\)"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
