"""Particles that run into things: bounces, rest, sliding, and nothing is passed through."""

from __future__ import annotations

import math

import numpy as np
import pytest

from articulated import particles as ap
from articulated.particles.points import vectors
from articulated.spatial import Vec3

G = 9.81


def after(system, duration, h, solver="semi_implicit"):
    for _ in range(round(duration / h)):
        system.step(h, solver)
    return system


@pytest.mark.parametrize("solver", ["euler", "semi_implicit", "midpoint", "rk4"])
def test_heights_of_bounces_and_how_long_they_take(solver):
    k, height, h = 0.7, 1.0, 1e-3
    system = ap.System([(0, 0, height)], None, 1.0, [ap.Gravity()], [ap.Plane(restitution=k)])
    z, tops = [height], []
    while system.time < 4.0:
        system.step(h, solver)
        z.append(system.x[0, 2])
        if len(z) > 2 and z[-3] < z[-2] >= z[-1] and z[-2] > 1e-3:
            tops.append(z[-2])
    expected = [height * k ** (2 * n) for n in range(1, 9)]
    np.testing.assert_allclose(tops[:8], expected, rtol=2e-3)
    total = math.sqrt(2 * height / G) * (1 + k) / (1 - k)
    moving = np.flatnonzero(np.array(z) > 1e-5)[-1] * h
    assert moving == pytest.approx(total, rel=0.02)
    # Euler's method lets it go on for a step before it feels its weight
    assert abs(system.x[0, 2]) < (1e-5 if solver == "euler" else 1e-9)
    assert abs(system.v[0, 2]) < (2 * G * h if solver == "euler" else 1e-12)


def test_sliding_distance():
    mu, speed = 0.35, 3.0
    plane = ap.Plane((0, 0, 1), (0, 0, 0), friction=mu)
    system = ap.System([(0, 0, 0)], [(speed * 0.6, speed * 0.8, 0)], 1.0, [ap.Gravity()], [plane])
    after(system, 2.0, 1e-3)
    assert np.linalg.norm(system.x[0]) == pytest.approx(speed**2 / (2 * mu * G), rel=1e-3)
    np.testing.assert_allclose(system.v, 0.0, atol=1e-12)


@pytest.mark.parametrize(("angle", "slides"), [(0.28, False), (0.30, True)])
def test_a_slope_holds_what_its_friction_can(angle, slides):
    """tan 0.29 is about 0.3."""
    n = np.array([math.sin(angle), 0.0, math.cos(angle)])
    system = ap.System([(0, 0, 0)], None, 1.0, [ap.Gravity()], [ap.Plane(n, friction=math.tan(0.29))])
    after(system, 1.0, 1e-2)
    way = np.linalg.norm(system.x[0])
    expected = 0.5 * G * (math.sin(angle) - math.tan(0.29) * math.cos(angle)) if slides else 0.0
    assert way == pytest.approx(expected, abs=1e-9, rel=1e-6)


@pytest.mark.parametrize("solver", ["euler", "semi_implicit", "midpoint", "rk4"])
def test_what_rests_leaves_when_it_is_pulled_off(solver):
    pull = ap.Acceleration(lambda t, x: Vec3(0.0, 0.0, 20.0 * t - 9.0))
    system = ap.System([(0, 0, 0)], None, 1.0, [pull], [ap.Plane()])
    after(system, 0.44, 0.01, solver)
    assert abs(system.x[0, 2]) < 5e-3
    after(system, 0.5, 0.01, solver)
    assert system.x[0, 2] > 0.1


THIN = {
    "plane": ap.Plane((0, 0, 1), (0, 0, 0), 0.5),
    "sphere": ap.Sphere((0, 0, -0.05), 0.05, 0.5),
    "capsule": ap.Capsule([(-0.2, 0, -0.01), (0.2, 0, -0.01)], 0.01, 0.5),
    "box": ap.Box((0, 0, -0.005), (1.0, 1.0, 0.01), restitution=0.5),
}


@pytest.mark.parametrize("name", THIN)
def test_nothing_fast_passes_through(name):
    """At 100 m/s and 10 ms a particle goes a metre in a step: through whatever is thinner, if nobody looks."""
    for start in np.linspace(0.05, 0.95, 10):
        system = ap.System([(0, 0, start)], [(0, 0, -100.0)], 1.0, colliders=[THIN[name]])
        system.step(0.01)
        assert system.v[0, 2] == pytest.approx(50.0)
        assert system.x[0, 2] == pytest.approx(50.0 * (0.01 - start / 100.0), abs=1e-6)


@pytest.mark.parametrize("name", THIN)
def test_nothing_passes_through_what_it_grazes(name, rng):
    """Down by less than two centimetres on a way of 38: nearer than that all along, no headway for who knows the gap alone."""
    for down in np.linspace(0.004, 0.02, 7):
        system = ap.System([(-0.19, 0, 0.001)], [(38.0, 0, -100.0 * down)], 1.0, colliders=[THIN[name]])
        system.step(0.01)
        assert system.v[0, 2] > 0.0
        assert system.x[0, 2] > 0.0


@pytest.mark.parametrize("name", THIN)
def test_gaps_are_distances(name, rng):
    """They grow by a metre a metre along the normal, which is the gradient."""
    collider, e = THIN[name], 1e-6
    x = rng.uniform(-0.5, 0.5, size=(400, 3)) * [1, 1, 0.3]

    def gap(x):
        return collider.gap(0.0, vectors(x))

    distance, normal = gap(x)
    n = np.stack(np.broadcast_arrays(*normal, distance), axis=1)[:, :3]
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, rtol=1e-12)
    gradient = np.stack([(gap(x + e * axis)[0] - gap(x - e * axis)[0]) / (2 * e) for axis in np.eye(3)], axis=1)
    smooth = np.linalg.norm(gradient, axis=1) > 0.999  # not where two faces are as near
    assert smooth.mean() > 0.97
    np.testing.assert_allclose(n[smooth], gradient[smooth], atol=1e-4)
    outside = distance > 0.0
    surface = x[outside] - n[outside] * distance[outside, None]
    np.testing.assert_allclose(gap(surface)[0], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", THIN)
def test_a_heap_stays_outside(name, rng):
    x = rng.uniform((-0.05, -0.05, 0.15), (0.05, 0.05, 0.25), size=(200, 3))
    system = ap.System(
        x, rng.normal(size=(200, 3)), 1.0, [ap.Gravity()], [THIN[name], ap.Plane(point=(0, 0, -0.3), friction=0.5)]
    )
    for _ in range(200):
        system.step(5e-3)
        for collider in system.colliders:
            assert np.min(collider.gap(0.0, vectors(system.x))[0]) > -1e-9
    assert np.isfinite(system.state).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.Plane((0, 0, 0)), r"Plane: normal is the zero vector; give it a direction"),
        (lambda: ap.Plane(restitution=1.5), r"Plane: restitution is 1.5; expected 0 to 1"),
        (lambda: ap.Plane(friction=-0.1), r"Plane: friction is -0.1; expected a number above zero, or zero"),
        (lambda: ap.Sphere((0, 0, 0), 0.0), r"Sphere: radius is 0; expected a number above zero"),
        (lambda: ap.Capsule([(0, 0, 0)], 1.0), r"Capsule: ends has shape \(1, 3\); expected \(2, 3\)"),
        (lambda: ap.Box((0, 0, 0), (1, 1, -1)), r"Box: size is \[1.0, 1.0, -1.0\]; expected three lengths above zero"),
        (lambda: ap.Box((0, 0, 0), (1, 1, 1), np.ones((3, 3))), r"Box: axes are no rotation"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
