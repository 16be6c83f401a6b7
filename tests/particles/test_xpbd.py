"""XPBD with small steps: exact for one element, converges for many, keeps momentum, never blows up; colours of elements."""

from __future__ import annotations

import math

import numpy as np
import pytest

from articulated import particles as ap
from articulated.particles.points import vectors
from articulated.particles.solvers.colours import independent

G = 9.81


def rope(n, length, stiffness, forces=(), end=(1.0, 0, 0), **more):
    """Of n springs, and a mass of 1 kg."""
    x = np.linspace((0, 0, 0), np.multiply(end, length), n + 1)
    pairs = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    return ap.System(x, None, 1.0 / n, [ap.Gravity(), ap.Springs(pairs, stiffness), *forces], pinned=[0], **more)


class TestColours:
    @pytest.mark.parametrize("size", [2, 4])
    def test_no_two_of_one_share_a_particle(self, size, rng):
        some = np.array([rng.choice(60, size, replace=False) for _ in range(300)])
        groups = independent(some)
        np.testing.assert_array_equal(np.sort(np.concatenate(groups)), np.arange(300))
        for group in groups:
            assert len(np.unique(some[group])) == size * len(group)
        most = np.bincount(some.ravel()).max()
        assert most <= len(groups) <= size * (most - 1) + 1  # each element has so many neighbours at most

    def test_a_chain_has_two(self):
        groups = independent(np.stack([np.arange(9), np.arange(1, 10)], axis=1))
        assert [group.tolist() for group in groups] == [[0, 2, 4, 6, 8], [1, 3, 5, 7]]

    def test_none(self):
        assert independent(np.zeros((0, 2), dtype=int)) == []


class TestOneElementIsImplicitEuler:
    @pytest.mark.parametrize(("stiffness", "damping"), [(60.0, 1.1), (0.0, 2.0), (1e9, 0.0), (1e6, 1e3)])
    def test_spring(self, stiffness, damping):
        springs = ap.Springs([(0, 1)], stiffness, damping, 1.0)
        one, other = (ap.System([(0, 0, 0), (1.3, 0, 0)], [(0.2, 0, 0), (0, 0, 0)], [1.0, 0.7], [springs]) for _ in range(2))
        assert one.step(0.02, ap.XPBD(substeps=10)) < 1e-12
        other.step(0.002, "implicit_euler", steps=10)
        np.testing.assert_allclose(one.state, other.state, rtol=0.0, atol=1e-11)
        assert abs(one.v[0, 0] - 0.2) > 5e-3

    @pytest.mark.parametrize(("stiffness", "damping"), [(60.0, 1.1), (0.0, 2.0), (1e9, 0.0), (1e6, 1e3)])
    @pytest.mark.parametrize("size", [3, 4])
    def test_bending(self, stiffness, damping, size, rng):
        """Linear, in three dimensions: all of them at once."""
        weights = rng.normal(size=size)
        weights -= weights.mean()
        x, v, mass = rng.normal(size=(size, 3)), rng.normal(size=(size, 3)), rng.uniform(0.5, 2.0, size)
        bending = ap.Bending([range(size)], stiffness, damping, weights)
        one, other = (ap.System(x, v, mass, [bending, ap.Gravity()]) for _ in range(2))
        one.step(0.02, ap.XPBD(substeps=10))
        other.step(0.002, "implicit_euler", steps=10)
        np.testing.assert_allclose(one.state, other.state, rtol=0.0, atol=1e-9)
        assert np.abs(one.v - v).max() > 0.05

    def test_iterations_solve_what_a_pass_does_not(self):
        """A substep of many elements, too, is one of implicit Euler."""
        bend = ap.Bending([(0, 1, 2), (1, 2, 3), (2, 3, 4)], 50.0, 0.3)
        one, other = (rope(4, 1.0, 300.0, [bend, ap.Drag(0.0)]) for _ in range(2))
        left = one.step(0.02, ap.XPBD(2, 300))
        assert left < 1e-9
        other.step(0.01, ap.ImplicitEuler(turns=40, tolerance=1e-13), steps=2)
        np.testing.assert_allclose(one.state, other.state, rtol=0.0, atol=1e-6)
        assert rope(4, 1.0, 300.0, [bend]).step(0.02, ap.XPBD(2, 1)) > 1e-4  # what one pass leaves is told


class TestMoreSubsteps:
    def test_swing_of_a_rope(self):
        """Towards that of a method of high order; half the substep, half the error."""
        exact = rope(4, 1.0, 3e3)
        exact.step(0.4, ap.Adaptive(1e-10, 1e-12))
        errors = []
        for substeps in (100, 200, 400):
            system = rope(4, 1.0, 3e3)
            system.step(0.02, ap.XPBD(substeps), steps=20)
            errors.append(np.abs(system.x - exact.x).max())
        assert errors[-1] < 3e-3
        np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 1.0, atol=0.35)

    def test_stretch_of_a_rope_that_hangs(self):
        """Towards that of its weight; half the substep, a quarter of the error."""
        n, k = 6, 1e5
        weight = G / n * np.arange(n, 0, -1)
        errors = []
        for substeps in (10, 20, 40):
            system = rope(n, 1.0, k, [ap.Drag(0.2)], (0, 0, -1.0))
            system.step(0.02, ap.XPBD(substeps), steps=200)
            errors.append(np.abs(np.diff(-system.x[:, 2]) - 1.0 / n - weight / k).max())
            assert np.abs(system.v).max() < 1e-3
        np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.2)

    @pytest.mark.parametrize(("n", "h"), [(8, 0.02), (20, 0.01)])
    def test_a_rope_that_cannot_stretch(self, n, h):
        system = rope(n, 1.0, 1e9, [ap.Drag(0.3)], (0, 0, -1.0))
        for _ in range(100):
            system.step(h, ap.XPBD(substeps=20))
            assert abs(np.linalg.norm(np.diff(system.x, axis=0), axis=1).sum() - 1.0) < 1e-3


class TestWhatIsKept:
    def test_momentum_of_a_blob(self, rng):
        n = 20
        pairs = [(i, j) for i in range(n) for j in range(i) if (i * j) % 3 == 1]
        x, v, mass = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.uniform(0.5, 2.0, n)
        bending = ap.Bending(np.arange(18).reshape(6, 3), 30.0, 0.1)
        system = ap.System(x + 1e3, v, mass, [ap.Springs(pairs, 1e4, 0.3, rng.uniform(0.5, 1.5, len(pairs))), bending])
        p, _ = system.momentum()
        system.step(0.02, "xpbd", steps=50)
        np.testing.assert_allclose(system.momentum()[0], p, rtol=0.0, atol=1e-12 * np.abs(mass[:, None] * v).sum())
        assert np.abs(system.v - v).max() > 0.5

    @pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e9])
    def test_nothing_blows_up(self, stiffness, rng):
        """Not even what begins all wrong; the energy that was in it is not all that comes of it."""
        n = 30
        pairs = [(i, j) for i in range(n) for j in range(i) if (i * j) % 3 == 1]
        rest = rng.uniform(0.5, 1.5, len(pairs))
        bending = ap.Bending(np.arange(n).reshape(-1, 3), stiffness)
        x, v, mass = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.uniform(0.01, 2.0, n)
        system = ap.System(x, v, mass, [ap.Springs(pairs, stiffness, 0.0, rest), bending])
        energy = system.energy()
        for _ in range(100):
            system.step(0.02, "xpbd")
            assert system.energy() < energy
        assert np.abs(system.x - system.mass @ system.x / system.mass.sum()).max() < 10.0

    def test_cloth_on_a_ball_stays_pinned_and_outside(self):
        cloth = ap.grid_cloth((-0.3, -0.3, 0.32), (0.6, 0, 0), (0, 0.6, 0), 10, 10, 0.2, 1e9, bending=1e-4)
        things = [ap.Sphere((0, 0, 0.15), 0.15, friction=0.4), ap.Plane(friction=0.4)]
        wind = ap.TriangleWind(cloth.triangles, 0.3, (1.0, 0, 0))
        system = ap.System(cloth.x, None, cloth.mass, [ap.Gravity(), wind, *cloth.forces], things, pinned=[0, 9])
        for _ in range(25):
            system.step(0.02, ap.XPBD(10))
            for thing in things:
                assert np.min(thing.gap(0.0, vectors(system.x))[0]) > -1e-9
            np.testing.assert_array_equal(system.x[[0, 9]], cloth.x[[0, 9]])
        assert system.x[:, 2].min() < 0.2
        springs = system.forces[2]
        lengths = np.linalg.norm(system.x[springs.pairs[:, 0]] - system.x[springs.pairs[:, 1]], axis=1)
        assert np.median(np.abs(lengths / springs.rest_length - 1.0)) < 0.01
        assert system.time == pytest.approx(0.5)

    def test_heights_of_bounces(self):
        """Velocities are those of half a step before, as of the semi-implicit method, which this is where nothing is joined."""
        one, other = (ap.System([(0, 0, 1.0)], None, 1.0, [ap.Gravity()], [ap.Plane(restitution=0.7)]) for _ in range(2))
        for _ in range(100):
            one.step(0.02, "xpbd")
            other.step(0.001, steps=20)
            np.testing.assert_allclose(one.state, other.state, rtol=0.0, atol=1e-9)

    def test_same_bits_again(self):
        systems = [rope(9, 1.0, 1e6, [ap.Bending([(0, 1, 2), (3, 4, 5)], 3.0)]) for _ in range(2)]
        systems[0].step(0.02, "xpbd", steps=4)
        for _ in range(4):
            systems[1].step(0.02, "xpbd")
        assert systems[0].state.tobytes() == systems[1].state.tobytes()


def test_what_is_no_constraint_acts_explicitly(rng):
    """And is asked at the time of each substep."""
    push = ap.OwnForce(lambda t, x, v, mass: np.full_like(x, math.cos(t)))
    system = ap.System([(0, 0, 0)], None, 2.0, [push, ap.OwnLaw(lambda t, points: [points[0].x * -3.0])])
    other = ap.System([(0, 0, 0)], None, 2.0, system.forces)
    system.step(0.5, ap.XPBD(substeps=50))
    other.step(0.01, steps=50)
    np.testing.assert_allclose(system.state, other.state, rtol=1e-12)


def test_no_particles():
    nothing = ap.System(np.zeros((0, 3)), forces=[ap.Gravity(), ap.Springs(np.zeros((0, 2), int), 1.0)])
    assert nothing.step(0.1, "xpbd") == 0.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.XPBD(substeps=0), r"XPBD: substeps is 0; expected a whole number, 1 or more"),
        (lambda: ap.XPBD(iterations=2.5), r"XPBD: iterations is 2.5; expected a whole number, 1 or more"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
