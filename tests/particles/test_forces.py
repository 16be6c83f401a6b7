"""Forces are minus the gradients of their energies, and their products the derivatives of forces."""

from __future__ import annotations

import numpy as np
import pytest

from articulated import particles as ap
from articulated.scalar import exp, sin, sqrt, where
from articulated.spatial import Vec3

N = 12
RNG = np.random.default_rng(0)
X, V, MASS = RNG.normal(size=(N, 3)), RNG.normal(size=(N, 3)), RNG.uniform(0.5, 2.0, N)
PAIRS = np.array([(i, j) for i in range(N) for j in range(i) if (i + j) % 3 == 0])
TRIPLES = np.array([(i, (i + 1) % N, (i + 2) % N) for i in range(N)])
HINGES = np.array([(i, (i + 1) % N, (i + 3) % N, (i + 7) % N) for i in range(N)])


def torsion(t, points, stiffness):
    """A law of one's own of four particles: ½ k V², with the volume V between them."""
    a, b, c, d = (point.x for point in points)
    volume = (b - a).dot((c - a).cross(d - a)) * (1.0 / 6.0)
    push = volume * stiffness * (-1.0 / 6.0)
    on_b, on_c, on_d = (c - a).cross(d - a) * push, (d - a).cross(b - a) * push, (b - a).cross(c - a) * push
    return [-(on_b + on_c + on_d), on_b, on_c, on_d]


def torsion_energy(t, points, stiffness):
    a, b, c, d = (point.x for point in points)
    volume = (b - a).dot((c - a).cross(d - a)) * (1.0 / 6.0)
    return 0.5 * stiffness * volume * volume


def gusts(t, x):
    return Vec3(sin(x.z + t), exp(x.x * 0.3) * 0.5, where(x.y > 0.0, x.y * x.y, 0.0))


FORCES = {
    "gravity": ap.Gravity((0.3, -0.2, -9.81)),
    "attractor": ap.Acceleration(ap.attractor((0.1, 0.2, 0.3), 4.0, 0.5)),
    "drag": ap.Drag(0.7),
    "wind": ap.Drag(RNG.uniform(0.1, 1.0, N), wind=ap.vortex((0.1, 0, 0), (1, 2, 3), 5.0, 0.4)),
    "gusts": ap.Drag(0.7, gusts),
    "springs": ap.Springs(PAIRS, RNG.uniform(10.0, 100.0, len(PAIRS)), RNG.uniform(0.1, 1.0, len(PAIRS)), 0.4),
    "bending": ap.Bending(TRIPLES, 30.0, 0.2),
    "hinges": ap.Bending(HINGES, 30.0, 0.2, ap.hinge_weights(X, HINGES)),
    "cloth": ap.TriangleWind(TRIPLES, 0.8, wind=gusts),
    "volumes": ap.OwnLaw(torsion, HINGES, (RNG.uniform(1.0, 9.0, N),), torsion_energy),
}
CONSERVATIVE = ["gravity", "springs", "bending", "hinges", "volumes"]
LINEAR = ["gravity", "drag", "bending", "hinges"]


@pytest.mark.parametrize("name", FORCES)
def test_product_is_the_derivative_of_the_force(name):
    force, h, e = FORCES[name].bound(X, MASS), 0.3, 1e-5
    for seed in range(5):
        p = np.random.default_rng(seed).normal(size=(N, 3))
        ahead, behind = (force.force(0.2, X + s * h * h * p, V + s * h * p, MASS) for s in (e, -e))
        expected = -(ahead - behind) / (2 * e)
        scale = max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(force.product(0.2, X, V, MASS, p, h), expected, atol=1e-6 * scale)


@pytest.mark.parametrize("name", CONSERVATIVE)
def test_force_is_minus_the_gradient_of_the_energy(name):
    force, e = FORCES[name].bound(X, MASS), 1e-5
    gradient = np.zeros((N, 3))
    for k in np.ndindex(N, 3):
        step = np.zeros((N, 3))
        step[k] = e
        gradient[k] = (force.energy(0.0, X + step, MASS) - force.energy(0.0, X - step, MASS)) / (2 * e)
    expected = force.force(0.0, X, np.zeros((N, 3)), MASS)
    np.testing.assert_allclose(-gradient, expected, atol=1e-6 * max(1.0, np.abs(expected).max()))


def matrix(force, h, convex):
    columns = [force.product(0.2, X, V, MASS, p.reshape(N, 3), h, convex).ravel() for p in np.eye(3 * N)]
    return np.array(columns).T


@pytest.mark.parametrize("name", FORCES)
def test_diagonal_is_that_of_the_product(name):
    force = FORCES[name].bound(X, MASS)
    for convex in (False, True):
        A = matrix(force, 0.3, convex).reshape(N, 3, N, 3)
        blocks = force.diagonal(0.2, X, V, MASS, 0.3, convex)
        np.testing.assert_allclose(blocks, A[np.arange(N), :, np.arange(N)], atol=1e-12 * max(1.0, np.abs(A).max()))


@pytest.mark.parametrize("name", FORCES)
def test_what_solvers_get_is_symmetric_and_never_negative(name):
    A = matrix(FORCES[name].bound(X, MASS), 0.3, convex=True)
    np.testing.assert_allclose(A, A.T, atol=1e-12 * max(1.0, np.abs(A).max()))
    assert np.linalg.eigvalsh(A).min() > -1e-12 * max(1.0, np.abs(A).max())


@pytest.mark.parametrize("name", LINEAR)
def test_of_linear_forces_solvers_get_all(name):
    force = FORCES[name].bound(X, MASS)
    np.testing.assert_allclose(matrix(force, 0.3, True), matrix(force, 0.3, False), atol=1e-12)


def test_of_stretched_springs_solvers_get_all():
    springs = ap.Springs(PAIRS, 50.0, 0.0, 0.1).bound(X, MASS)  # damping would add what depends on velocities
    np.testing.assert_allclose(matrix(springs, 0.3, True), matrix(springs, 0.3, False), atol=1e-10)
    short = ap.Springs(PAIRS, 50.0, 0.0, 9.0).bound(X, MASS)
    assert np.linalg.eigvalsh(matrix(short, 0.3, False)).min() < -1.0


@pytest.mark.parametrize("name", ["springs", "bending", "volumes"])
def test_what_acts_between_particles_moves_nothing_as_a_whole(name):
    f = FORCES[name].bound(X, MASS).force(0.0, X, V, MASS)
    scale = np.abs(f).max()
    np.testing.assert_allclose(f.sum(axis=0), 0.0, atol=1e-13 * scale)
    if name != "bending":  # which is no force along lines: of what turns as a whole it takes the curvature along
        np.testing.assert_allclose(np.cross(X, f).sum(axis=0), 0.0, atol=1e-12 * scale)


def test_bending_of_what_is_flat_is_none():
    hinges = np.array([(0, 1, 2, 3)])
    square = np.array([(0.0, 0.0, 0.0), (1.0, 0.2, 0.0), (0.4, 0.9, 0.0), (0.6, -1.1, 0.0)])
    weights = ap.hinge_weights(square, hinges)
    np.testing.assert_allclose(weights @ square, 0.0, atol=1e-12)
    lifted = square + np.outer([0.0, 0.0, 0.3, 0.0], [0.0, 0.0, 1.0])
    assert np.abs(weights @ lifted).max() > 0.1


def test_a_spring_without_length_pushes_nowhere():
    x = np.zeros((2, 3))
    springs = ap.Springs([(0, 1)], 1e3, 5.0, 0.5).bound(x, np.ones(2))
    v = np.array([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    assert not springs.force(0.0, x, v, np.ones(2)).any()
    assert np.isfinite(springs.product(0.0, x, v, np.ones(2), v, 0.1, convex=True)).all()
    assert springs.energy(0.0, x, np.ones(2)) == pytest.approx(0.5 * 1e3 * 0.25)


def test_a_triangle_without_area_feels_no_wind():
    x = np.array([(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0)])
    wind = ap.TriangleWind([(0, 1, 2)], 1.0, (0.0, 0.0, 5.0)).bound(x, np.ones(3))
    assert not wind.force(0.0, x, np.zeros((3, 3)), np.ones(3)).any()


def test_wind_along_a_triangle_passes_by_and_across_pushes():
    x = np.array([(0.0, 0, 0), (1.0, 0, 0), (0.0, 1, 0)])
    for order in ((0, 1, 2), (2, 1, 0)):
        wind = ap.TriangleWind([order], 0.6, (7.0, 0.0, 5.0)).bound(x, np.ones(3))
        np.testing.assert_allclose(wind.force(0.0, x, np.zeros((3, 3)), np.ones(3)), [(0, 0, 0.6 * 0.5 * 5.0 / 3)] * 3)


def test_a_force_of_ones_own_on_arrays():
    own = ap.OwnForce(lambda t, x, v, mass: -np.outer(mass, [0.0, 0.0, t]))
    np.testing.assert_array_equal(own.force(2.0, X, V, MASS)[:, 2], -2.0 * MASS)
    with pytest.raises(ValueError, match=r"OwnForce: what the function returned has shape \(3,\); expected \(12, 3\)"):
        ap.OwnForce(lambda t, x, v, mass: np.zeros(3)).force(0.0, X, V, MASS)


def test_a_law_of_ones_own_uses_what_scalars_have():
    law = ap.OwnLaw(lambda t, points, k: [points[0].x * (-k / sqrt(points[0].x.dot(points[0].x) + 0.1))], None, (3.0,))
    force, e = law.bound(X, MASS), 1e-6
    p = np.random.default_rng(1).normal(size=(N, 3))
    expected = -(force.force(0, X + e * p, V, MASS) - force.force(0, X - e * p, V, MASS)) / (2 * e)
    np.testing.assert_allclose(force.product(0.0, X, V, MASS, p, 1.0), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.Springs([(0, 1)], -3.0), r"Springs: stiffness is -3; expected 0 or more"),
        (lambda: ap.Springs([(0, 1), (1, 2)], [1.0, -2.0]), r"Springs: stiffness\[1\] is -2; expected 0 or more"),
        (
            lambda: ap.Springs([(0, 1), (1, 2)], [1.0, 2.0, 3.0]),
            r"stiffness has 3 entries; expected one number, or one for each spring: 2",
        ),
        (lambda: ap.Springs([(0, 1)], 1.0, np.nan), r"Springs: damping is nan; every entry must be finite"),
        (lambda: ap.Springs([(0, 1)], 1.0, 0.0, -1.0), r"Springs: rest_length is -1; expected 0 or more"),
        (lambda: ap.Springs([(0, 0)], 1.0), r"Springs: pairs\[0\] is \[0, 0\]; expected 2 particles that are not the same"),
        (lambda: ap.Springs([(0, -1)], 1.0), r"Springs: pairs\[0, 1\] is -1; particles are counted from 0"),
        (
            lambda: ap.Springs([(0, 1, 2)], 1.0),
            r"Springs: pairs has shape \(1, 3\) of int64; expected integers, shape \(m, 2\)",
        ),
        (lambda: ap.Springs([(0, 99)], 1.0).bound(X, MASS), r"pairs\[0, 1\] is 99; there are 12 particles, the last is 11"),
        (
            lambda: ap.Springs([(0, 1)], 1.0).bound(0 * X, MASS),
            r"pairs\[0\] joins particles \[0, 1\], which start in one place",
        ),
        (lambda: ap.Gravity((0, 0)), r"Gravity: acceleration has shape \(2,\); expected \(3,\)"),
        (
            lambda: ap.Drag(np.ones(3)).bound(X, MASS),
            r"Drag: coefficient has 3 entries; expected one number, or one for each particle: 12",
        ),
        (lambda: ap.Drag(1.0, (0, 0, np.inf)), r"Drag: wind\[2\] is inf; every entry must be finite"),
        (lambda: ap.vortex((0, 0, 0), (0, 0, 0), 1.0), r"vortex: axis is the zero vector; give it a direction"),
        (lambda: ap.Bending(HINGES, 1.0), r"Bending: weights are missing"),
        (lambda: ap.Bending(TRIPLES, 1.0, 0.0, (1, 1, 1)), r"weights of an element do not add up to zero"),
        (lambda: ap.hinge_weights(X * 0 + [1, 2, 3], HINGES), r"hinges\[0\] has a triangle without an area"),
        (lambda: ap.TriangleWind([(0, 1, 40)], 1.0).bound(X, MASS), r"TriangleWind: triangles\[0, 2\] is 40; there are 12"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
