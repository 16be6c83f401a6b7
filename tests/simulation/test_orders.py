"""What each integrator promises, measured."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import RK45, solve_ivp
from scipy.special import ellipj, ellipk, ellipkinc

import articulated as art
from articulated.dynamics.mechanism import mechanism
from articulated.simulation import dopri5
from articulated.simulation.forces import Forces
from articulated.simulation.runge_kutta import Point, runge_kutta_step
from articulated.simulation.scene import Scene


@pytest.fixture(scope="module")
def start(double_pendulum):
    return double_pendulum.random(1), np.random.default_rng(0).normal(size=6)


@pytest.fixture(scope="module")
def end(double_pendulum, start):
    """Where the double pendulum is after one second, to twelve digits, by SciPy's own solver."""
    system = art.first_order(double_pendulum)
    solution = solve_ivp(system, (0.0, 1.0), system.pack(*start), method="DOP853", rtol=1e-13, atol=1e-13)
    q, v = system.unpack(solution.y[:, -1])
    return q, v


def error(rig, q, v, end) -> float:
    return float(np.linalg.norm(np.concatenate([art.difference(rig, end[0], q), v - end[1]])))


@pytest.mark.parametrize(
    ("integrator", "order", "steps"),
    [
        ("semi_implicit", 1, [250, 500, 1000, 2000]),
        ("euler", 1, [500, 1000, 2000, 4000]),
        ("midpoint", 2, [100, 200, 400, 800]),
        ("rk4", 4, [50, 100, 200, 400]),
    ],
)
def test_order(double_pendulum, start, end, integrator, order, steps):
    errors = []
    for n in steps:
        trajectory = art.Simulation(double_pendulum, dt=1.0 / n, integrator=integrator).run(*start, duration=1.0, fps=1)
        errors.append(error(double_pendulum, trajectory.q[-1], trajectory.v[-1], end))
    orders = [np.log2(a / b) for a, b in pairwise(errors)]
    assert orders[-1] == pytest.approx(order, abs=0.15), orders


def test_order_of_dopri5(double_pendulum):
    """Its weights at fixed steps: order 5, on the manifold. Over four starts, as one may have a small leading error."""
    system = art.first_order(double_pendulum)
    forces = Forces(Scene(double_pendulum), [0.0] * 6, None, art.GRAVITY)
    errors = {200: 0.0, 400: 0.0}
    for seed in range(4):
        q0, v0 = double_pendulum.random(seed), np.random.default_rng(seed).normal(size=6)
        exact = solve_ivp(system, (0.0, 1.0), system.pack(q0, v0), method="DOP853", rtol=1e-13, atol=1e-14)
        for n in errors:
            point = Point(q0.tolist(), v0.tolist(), 0.0)
            for _ in range(n):
                point = runge_kutta_step(dopri5.DOPRI5, point, forces, 1.0 / n)
            errors[n] += error(double_pendulum, point.q, np.array(point.v), system.unpack(exact.y[:, -1]))
    assert np.log2(errors[200] / errors[400]) == pytest.approx(5, abs=0.2), errors


def test_dense_output_of_dopri5_is_of_order_4(double_pendulum, start):
    m, forces = mechanism(double_pendulum), Forces(Scene(double_pendulum), [0.0] * 6, None, art.GRAVITY)
    system, errors = art.first_order(double_pendulum), []
    for h in (0.1, 0.05, 0.025):
        exact = solve_ivp(system, (0.0, 0.4 * h), system.pack(*start), method="DOP853", rtol=1e-13, atol=1e-14)
        motion = dopri5.restarted(dopri5.begin(Point(start[0].tolist(), start[1].tolist(), 0.0), h), forces)
        motion = dopri5.attempt(motion, forces, h, 1.0, 1.0)
        assert motion.t == h
        between = dopri5.interpolated(m, motion, 0.4 * h)
        errors.append(error(double_pendulum, between.q, np.array(between.v), system.unpack(exact.y[:, -1])))
    # the error of one step of a method of order 4 is O(h^5)
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(5, abs=0.3), errors


def test_tableau_is_the_published_one():
    """SciPy's RK45 is the same method."""
    for row, theirs in zip(dopri5.DOPRI5.a, RK45.A, strict=True):
        np.testing.assert_allclose(row, theirs[: len(row)], rtol=1e-15)
    np.testing.assert_allclose(dopri5.DOPRI5.b, RK45.B, rtol=1e-15)
    np.testing.assert_allclose(np.abs(dopri5._ERROR), np.abs(RK45.E), rtol=1e-15)
    np.testing.assert_allclose(dopri5._DENSE, RK45.P[:, 1:], rtol=1e-15)


def test_dopri5_keeps_its_energy(double_pendulum, start):
    run = art.Simulation(double_pendulum, integrator="dopri5", rtol=1e-10, atol=1e-12).run(*start, duration=10.0)
    assert run.report["energy drift"].value < 1e-8
    assert np.abs(run.energy - run.energy[0]).max() < 1e-8 * np.abs(run.energy).max()


def test_dopri5_error_follows_its_tolerance(double_pendulum, start, end):
    errors = []
    for rtol in (1e-4, 1e-6, 1e-8):
        run = art.Simulation(double_pendulum, integrator="dopri5", rtol=rtol, atol=rtol).run(*start, duration=1.0)
        errors.append(error(double_pendulum, run.q[-1], run.v[-1], end))
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[2] < 1e-6


def free_body(moments) -> art.Rig:
    builder = art.RigBuilder("book")
    builder.link("book", 1.3, inertia=moments)
    return builder.build("free")


@pytest.mark.parametrize("perturbation", [0.02, -0.5, 1.0])
def test_free_body_about_its_intermediate_axis(perturbation):
    """Euler's equations in elliptic functions: Landau, Lifshitz, Mechanics, section 37."""
    moments, w0 = np.array([0.6, 1.0, 1.5]), np.array([perturbation, 3.0, 0.3])
    rig = free_body(moments)
    v0 = np.concatenate([[0.4, -0.2, 0.1], w0])
    run = art.Simulation(rig, gravity=(0, 0, 0), integrator="dopri5", rtol=1e-12, atol=1e-13).run(v0=v0, duration=10.0)

    twice_energy, momentum2 = (moments * w0**2).sum(), (moments**2 * w0**2).sum()
    # the axis that the momentum circles is the third or, for little momentum, the first
    order = [0, 1, 2] if momentum2 > twice_energy * moments[1] else [2, 1, 0]
    J1, J2, J3 = moments[order]
    rate = np.sqrt((J3 - J2) * (momentum2 - twice_energy * J1) / (J1 * J2 * J3))
    m = (J2 - J1) * (twice_energy * J3 - momentum2) / ((J3 - J2) * (momentum2 - twice_energy * J1))
    sign = np.sign(w0[order[2]])
    size1 = sign * np.sqrt((twice_energy * J3 - momentum2) / (J1 * (J3 - J1)))
    size2 = np.sqrt((twice_energy * J3 - momentum2) / (J2 * (J3 - J2)))
    size3 = sign * np.sqrt((momentum2 - twice_energy * J1) / (J3 * (J3 - J1)))
    phase = ellipkinc(np.arctan2(w0[order[1]] / size2, w0[order[0]] / size1), m)
    sn, cn, dn, _ = ellipj(phase + rate * run.time, m)
    expected = np.empty((len(run.time), 3))
    expected[:, order] = np.stack([size1 * cn, size2 * sn, size3 * dn], axis=-1)

    assert 0 < m < 1
    assert np.ptp(expected[:, 1]) > 5.9, "it turns over"
    np.testing.assert_allclose(run.v[:, 3:], expected, rtol=0, atol=1e-8)


def test_free_body_keeps_momentum_and_moves_straight():
    rig = free_body((0.6, 1.0, 1.5))
    v0 = np.array([0.4, -0.2, 0.1, 0.02, 3.0, 0.3])
    run = art.Simulation(rig, gravity=(0, 0, 0), integrator="dopri5", rtol=1e-12, atol=1e-13).run(v0=v0, duration=10.0)
    momentum = art.momentum(rig, run.q, run.v)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[:, :3], run.time[:, None] * v0[:3], rtol=0, atol=1e-9)


@pytest.mark.sweep
def test_momentum_of_a_free_rig_is_constant():
    """In zero gravity, over 10 s of rk4 at 1 ms, to 1e-12."""
    builder = art.RigBuilder("three")
    builder.link("a", 1.0, (0.1, 0.0, 0.0), (0.03, 0.04, 0.02))
    builder.link("b", 0.8, (0.0, 0.1, -0.2), (0.02, 0.03, 0.01))
    builder.link("c", 0.5, (0.0, 0.0, -0.2), (0.01, 0.02, 0.015))
    builder.joint("ball", "ball", "a", "b", xyz=(0, 0, -0.3))
    builder.joint("hinge", "revolute", "a", "c", xyz=(0, 0, 0.3), axis=(0, 1, 1))
    rig = builder.build("free")
    rng = np.random.default_rng(2)
    q0, v0 = rig.random(rng), rng.normal(size=rig.nv)
    run = art.Simulation(rig, dt=1e-3, gravity=(0, 0, 0), integrator="rk4").run(q0, v0, duration=10.0, fps=10)
    assert run.settings["dt"] == pytest.approx(1e-3)
    momentum = art.momentum(rig, run.q, run.v)
    size = np.linalg.norm(momentum[0].reshape(2, 3), axis=1).repeat(3)
    assert (np.abs(momentum - momentum[0]) / size).max() < 1e-12


def test_pendulum_period():
    """A point on a rod, let go from 2 rad: T = 4 √(l/g) K(sin²(θ/2))."""
    builder = art.RigBuilder("pendulum")
    builder.link("pivot")
    builder.link("bob", 1.0, (0.0, 0.0, -0.7))
    builder.joint("hinge", "continuous", "pivot", "bob", axis=(0, 1, 0))
    period = 4.0 * np.sqrt(0.7 / 9.81) * ellipk(np.sin(1.0) ** 2)
    run = art.Simulation(builder.build(), integrator="dopri5", rtol=1e-11, atol=1e-12).run(
        [2.0], duration=period, fps=2.0 / period
    )
    np.testing.assert_allclose(run.q[:, 0], [2.0, -2.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(run.v[:, 0], 0.0, atol=1e-8)
