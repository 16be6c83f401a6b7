"""Implicit Euler: closed forms, energy that never rises however stiff, conjugate gradients, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from articulated import particles as ap
from articulated.particles.points import vectors
from articulated.particles.solvers.implicit import conjugate_gradients

G = 9.81


def chain(n, length, stiffness, damping=0.0, **more):
    x = np.linspace((0, 0, 0), (length, 0, 0), n + 1)
    pairs = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    return x, ap.Springs(pairs, stiffness, damping, **more)


@pytest.mark.parametrize("iterations", [5, 40])
def test_conjugate_gradients(iterations, rng):
    n = 10
    A = rng.normal(size=(3 * n, 3 * n))
    A = A @ A.T + 3 * np.eye(3 * n)
    b = rng.normal(size=(n, 3))
    blocks = np.array([np.linalg.inv(A[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]) for k in range(n)])
    x, left = conjugate_gradients(lambda p: (A @ p.ravel()).reshape(n, 3), b, blocks, iterations)
    exact = np.linalg.solve(A, b.ravel()).reshape(n, 3)
    r = b - (A @ x.ravel()).reshape(n, 3)
    assert left == pytest.approx(np.einsum("ni,nij,nj", r, blocks, r), rel=1e-6, abs=1e-20)
    if iterations > 3 * n:
        np.testing.assert_allclose(x, exact, atol=1e-10)
        return
    # of all that so many products can make, that which is nearest in the norm of A
    P = np.zeros((3 * n, 3 * n))
    for k, block in enumerate(blocks):
        P[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = block
    space = [P @ b.ravel()]
    for _ in range(iterations - 1):
        space.append(P @ A @ space[-1] / np.linalg.norm(P @ A @ space[-1]))
    Q, _ = np.linalg.qr(np.array(space).T)
    best = Q @ np.linalg.solve(Q.T @ A @ Q, Q.T @ b.ravel())
    np.testing.assert_allclose(x.ravel(), best, atol=1e-8)


def test_order():
    m, k, d, T = 0.7, 60.0, 1.1, 1.0
    rate, turn = 0.5 * d / m, math.sqrt(k / m - (0.5 * d / m) ** 2)
    exact = 1.0 + 0.3 * math.exp(-rate * T) * (math.cos(turn * T) + rate / turn * math.sin(turn * T))
    errors = []
    for steps in (400, 800):
        system = ap.System([(0, 0, 0), (1.3, 0, 0)], None, [1.0, m], [ap.Springs([(0, 1)], k, d, 1.0)], pinned=[0])
        for _ in range(steps):
            assert system.step(T / steps, "implicit_euler") < 1e-9
        errors.append(abs(system.x[1, 0] - exact))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("stiffness", [1e2, 1e5, 1e9])
@pytest.mark.parametrize("h", [1e-3, 1e-2, 1e-1])
def test_energy_never_rises(stiffness, h):
    for seed in range(2):
        rng = np.random.default_rng(seed)
        n = 16
        x, pairs = rng.normal(size=(n, 3)), [(i, j) for i in range(n) for j in range(i) if (i * j) % 3 == 1]
        rest = np.linalg.norm(x[[i for i, _ in pairs]] - x[[j for _, j in pairs]], axis=1) * rng.uniform(0.8, 1.2, len(pairs))
        system = ap.System(x, rng.normal(size=(n, 3)), rng.uniform(0.5, 2.0, n), [ap.Springs(pairs, stiffness, 0.0, rest)])
        energy, momentum = system.energy(), system.momentum()[0]
        for _ in range(20):
            system.step(h, "implicit_euler")
            assert system.energy() <= energy * (1.0 + 1e-12)
            energy = system.energy()
        if stiffness < 1e6:
            np.testing.assert_allclose(system.momentum()[0], momentum, atol=1e-11)


def test_a_hanging_chain_is_a_catenary():
    """Ends 0.8 m apart, a chain of 1 m: z = c cosh(x/c), where 2 c sinh(0.4/c) = 1."""
    n = 24
    x, springs = chain(n, 1.0, 3e6, rest_length=1.0 / n)
    start = x * [0.8, 0, 0] - [0.4, 0, 0]
    start[:, 2] = -0.3 * np.sin(np.pi * x[:, 0])
    system = ap.System(start, None, 1.0 / n, [ap.Gravity(), springs, ap.Drag(0.05)], pinned=[0, n])
    for _ in range(80):
        system.step(0.1, "implicit_euler")
    c = brentq(lambda c: 2 * c * math.sinh(0.4 / c) - 1.0, 0.1, 10.0)
    sag = c * np.cosh(system.x[:, 0] / c) - c * math.cosh(0.4 / c)
    np.testing.assert_allclose(system.x[:, 2], sag, atol=3e-4)
    assert np.abs(system.v).max() < 1e-9


def test_a_stiff_rope_is_a_pendulum():
    """A bob on it swings in 2π √(L/g) (1 + θ²/16)."""
    n, angle = 4, 0.2
    x, springs = chain(n, 1.0, 1e6)
    x = x[:, :1] * [math.sin(angle), 0, -math.cos(angle)]
    mass = np.where(np.arange(n + 1) == n, 1.0, 1e-3)
    system = ap.System(x, None, mass, [ap.Gravity(), ap.Springs(springs.pairs, 1e6)], pinned=[0])
    crossings, h = [], 2e-3
    while len(crossings) < 2:
        before = system.x[n, 0]
        assert system.step(h, ap.ImplicitEuler(tolerance=1e-7)) < 1e-6
        if before > 0.0 >= system.x[n, 0] or before < 0.0 <= system.x[n, 0]:
            crossings.append(system.time - h * system.x[n, 0] / (system.x[n, 0] - before))
    half = math.pi * math.sqrt(1.0 / G) * (1 + angle**2 / 16)
    assert crossings[1] - crossings[0] == pytest.approx(half, rel=2e-3)
    assert np.linalg.norm(system.x[n]) == pytest.approx(1.0, abs=1e-4)


def test_cloth_falls_over_a_ball_and_stays_outside():
    n = 9
    x = np.array([(i * 0.06 - 0.24, j * 0.06 - 0.24, 0.33) for i in range(n) for j in range(n)])
    number = np.arange(n * n).reshape(n, n)
    pairs = [*zip(number[1:].flat, number[:-1].flat, strict=True), *zip(number[:, 1:].flat, number[:, :-1].flat, strict=True)]
    pairs += [*zip(number[1:, 1:].flat, number[:-1, :-1].flat, strict=True)]
    ball, floor = ap.Sphere((0, 0, 0.15), 0.15, friction=0.4), ap.Plane(friction=0.4)
    system = ap.System(x, None, 1e-3, [ap.Gravity(), ap.Springs(pairs, 200.0, 0.02), ap.Drag(1e-4)], [ball, floor])
    for _ in range(80):
        system.step(0.01, ap.ImplicitEuler(turns=2, iterations=30))
        for collider in (ball, floor):
            assert np.min(collider.gap(0.0, vectors(system.x))[0]) > -1e-9
    assert 0.25 < system.x[:, 2].max() < 0.35
    assert system.x[:, 2].min() < 0.15


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.ImplicitEuler(turns=0), r"ImplicitEuler: turns is 0; expected a whole number, 1 or more"),
        (lambda: ap.ImplicitEuler(iterations=2.5), r"ImplicitEuler: iterations is 2.5; expected a whole number"),
        (lambda: ap.ImplicitEuler(tolerance=np.nan), r"ImplicitEuler: tolerance is nan; expected a number, zero or more"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
