"""Chains: what an implicit step asks of them is solved exactly, against a dense solver."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import particles as ap
from articulated.particles.chains import Chains, Factor, band
from articulated.spatial import Sym3, Vec3


def strands(count, length, seed=0, stiffness=1e4, bending=0.02):
    """Chains with everything that acts along them."""
    rng = np.random.default_rng(seed)
    n = count * length
    number = np.arange(n).reshape(count, length)
    x = np.stack([np.repeat(np.arange(count), length) * 0.1, np.zeros(n), -0.02 * np.tile(np.arange(length), count)], axis=1)
    pairs = np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)
    triples = np.stack([number[:, :-2], number[:, 1:-1], number[:, 2:]], axis=-1).reshape(-1, 3)
    forces = [ap.Gravity(), ap.Springs(pairs, rng.uniform(0.5, 1.0, len(pairs)) * stiffness, 0.01), ap.Drag(1e-4)]
    if len(triples):
        forces.append(ap.Bending(triples, bending * stiffness, 1e-3))
    x += 1e-3 * rng.normal(size=x.shape)
    v = rng.normal(size=x.shape)
    v[number[:, 0]] = 0.0
    return ap.System(x, v, rng.uniform(1e-3, 2e-3, n), forces, pinned=number[:, 0])


def dense(system, h):
    n = len(system.x)
    columns = [system.product(0.0, system.x, system.v, p.reshape(n, 3), h).ravel() for p in np.eye(3 * n)]
    return np.array(columns).T + np.diag(np.repeat(system.mass, 3))


def test_factor_of_three_by_three(rng):
    A = rng.normal(size=(3, 3))
    A = A @ A.T + 0.1 * np.eye(3)
    b = rng.normal(size=3)
    x = Factor.of(Sym3.of(A.tolist())).solve(Vec3(*b))
    np.testing.assert_allclose(list(x), np.linalg.solve(A, b), rtol=1e-10)


@pytest.mark.parametrize(("count", "length"), [(1, 2), (1, 3), (1, 30), (5, 4), (7, 12)])
@pytest.mark.parametrize("stiffness", [1e2, 1e6])
def test_solution_is_that_of_a_dense_solver(count, length, stiffness, rng):
    system, h = strands(count, length, stiffness=stiffness), 5e-3
    assert system.chains == Chains(count, length)
    A = dense(system, h)
    free = np.repeat(system.inverse_mass > 0.0, 3)
    r = rng.normal(size=system.x.shape)
    blocks = band(system, 0.0, system.x, system.v, h)
    blocks[:, 0] += system.mass[:, None, None] * np.eye(3)
    found = system.chains.solve(blocks, r, system.inverse_mass == 0.0).ravel()
    expected = np.zeros_like(found)
    expected[free] = np.linalg.solve(A[np.ix_(free, free)], r.ravel()[free])
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_what_is_held_anywhere_is_left_out(rng):
    system, h = strands(3, 8), 5e-3
    held = rng.random(24) < 0.4
    A, free, r = dense(system, h) + 1e-3 * np.eye(72), np.repeat(~held, 3), rng.normal(size=(24, 3))
    blocks = band(system, 0.0, system.x, system.v, h)
    blocks[:, 0] += (system.mass[:, None, None] + 1e-3) * np.eye(3)
    found = system.chains.solve(blocks, r, held).ravel()
    np.testing.assert_allclose(found[free], np.linalg.solve(A[np.ix_(free, free)], r.ravel()[free]), rtol=1e-8)
    assert not found[~free].any()


def test_what_is_a_chain_and_what_is_none():
    x = np.random.default_rng(0).normal(size=(6, 3))

    def chains(*forces):
        return ap.System(x, forces=forces).chains

    assert chains(ap.Springs([(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)], 1.0)) == Chains(1, 6)
    assert chains(ap.Springs([(1, 0), (2, 1), (4, 3), (5, 4)], 1.0)) == Chains(2, 3)
    assert chains(ap.Springs([(0, 1), (2, 3), (4, 5)], 1.0), ap.Gravity()) == Chains(3, 2)
    assert chains(ap.Springs([(0, 1), (1, 2), (3, 4)], 1.0)) is None  # of three lengths
    assert chains(ap.Springs([(0, 3), (3, 4), (1, 2), (2, 5)], 1.0)) is None  # not one after the other
    assert chains(ap.Springs([(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)], 1.0)) is None  # a ring
    assert chains(ap.Gravity()) is None


def test_stiff_strands_stay_as_long_as_they_are():
    """A step of 5 ms, springs of 10⁷ N/m, grams: conjugate gradients would take thousands of turns."""
    system = strands(4, 12, stiffness=1e7, bending=1e-8)
    springs = system.forces[1]
    energy = system.energy()
    for k in range(60):
        left = system.step(5e-3, ap.ImplicitEuler(turns=20))
        assert left < (1e-3 if k > 10 else 0.1)
        assert system.energy() <= energy + 1e-9
        energy = system.energy()
        length = np.linalg.norm(system.x[springs.pairs[:, 0]] - system.x[springs.pairs[:, 1]], axis=1)
        np.testing.assert_allclose(length, springs.rest_length, rtol=2e-4)
