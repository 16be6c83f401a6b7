"""Terrain: the surface of rigs' ground, gaps that are no more than distances, and nothing that passes through hills."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

import articulated as art
from articulated import particles as ap
from articulated.particles.alone import are_alone
from articulated.particles.points import vectors
from articulated.particles.together import are_laws
from articulated.simulation.contact.gaps import _terrain

G = 9.81
SPACING, ORIGIN = (0.5, 0.4), (-2.8, -2.7, 0.1)


def hills(rng, height=1.0, **more):
    return ap.HeightField(rng.uniform(0, height, (12, 15)), SPACING, ORIGIN, **more)


def slope(angle, turned=0.6, **more):
    """An even slope, far from the edges; and the plane that it is."""
    steep = math.tan(angle) * np.array([math.cos(turned), math.sin(turned)])
    x, y = 0.5 * np.arange(41) - 10.0, 0.4 * np.arange(51) - 10.0
    field = ap.HeightField(steep[0] * x[None] + steep[1] * y[:, None], (0.5, 0.4), (-10.0, -10.0, 0.0), **more)
    return field, ap.Plane((-steep[0], -steep[1], 1.0), **more)


def height(field, x):
    return field._patch(vectors(x), vectors(np.ones_like(x))).height


class TestSurface:
    def test_it_is_that_of_rigs(self, rng):
        field = hills(rng)
        other = art.HeightField(field.heights, SPACING, ORIGIN)
        x = rng.uniform(-4, 4, (2000, 3))  # beyond the edges, too
        of_rigs = _terrain(other, field.heights.ravel(), vectors(x))
        _, n = field.gap(0.0, vectors(x))
        for a, b in zip(n, of_rigs.normal, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)
        at = np.column_stack([x[:, :2], height(field, x)])
        np.testing.assert_allclose(of_rigs.normal.dot(vectors(at)), of_rigs.offset, atol=1e-12)

    def test_slopes_and_how_they_change(self, rng):
        field, e = hills(rng), 1e-4
        x, way = rng.uniform(-4, 4, (5000, 3)), rng.normal(size=(5000, 3))
        patch = field._patch(vectors(x), vectors(way))
        for axis, found in zip(np.eye(3), (patch.x, patch.y), strict=False):
            np.testing.assert_allclose((height(field, x + e * axis) - height(field, x - e * axis)) / (2 * e), found, atol=1e-3)
        assert np.hypot(patch.x, patch.y).max() <= field.steepest
        inside = patch.end > 2 * e
        bend = (height(field, x + e * way) - 2 * patch.height + height(field, x - e * way)) / e**2
        inside &= field._patch(vectors(x), vectors(-way)).end > 2 * e
        assert (bend <= patch.bend + 1e-5)[inside].all()
        assert (bend > 0.5 * patch.bend)[inside].any()

    def test_gaps_are_no_more_than_distances(self, rng):
        for k in range(2):
            field = hills(rng, 0.3 * 9**k)
            line = np.linspace(-5, 5, 700)
            u, w = (part.ravel() for part in np.meshgrid(line, line))
            surface = np.column_stack([u, w, height(field, np.column_stack([u, w, u]))])
            x = rng.uniform((-3.5, -3.5, 0), (4.5, 2, 3), (500, 3))
            gap, _ = field.gap(0.0, vectors(x))
            outside = gap > 0.0
            distance, _ = cKDTree(surface).query(x)
            assert outside.any()
            assert (gap <= distance)[outside].all()
            np.testing.assert_array_equal(outside, x[:, 2] > height(field, x))

    def test_the_gap_of_an_even_slope_is_its_distance(self, rng):
        field, plane = slope(0.7)
        x = rng.uniform(-1, 1, (100, 3))
        expected, normal = plane.gap(0.0, vectors(x))
        gap, n = field.gap(0.0, vectors(x))
        np.testing.assert_allclose(gap[gap < 0], expected[gap < 0], atol=1e-12)
        along_x = ap.HeightField([(0.0, 1.0)] * 3, 1.0, (-0.5, -1.0, -0.5))  # steep along one axis: the bound is exact
        at = np.column_stack([np.full(50, 0.0), rng.uniform(-1, 1, 50), rng.uniform(0.1, 2, 50)])
        np.testing.assert_allclose(along_x.gap(0.0, vectors(at))[0], at[:, 2] / math.sqrt(2.0), rtol=1e-12)
        for a, b in zip(n, normal, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)

    def test_beyond_the_edges_it_goes_on_level(self):
        field = ap.HeightField([(1.0, 2.0), (1.0, 2.0)], 1.0)
        x = np.array([(-9.0, 0.5, 5.0), (9.0, 0.5, 5.0), (9.0, -70.0, 5.0)])
        np.testing.assert_allclose(height(field, x), [1.0, 2.0, 2.0])
        system = ap.System(x, [(0, 0, -1000.0)] * 3, colliders=[field])
        system.step(0.01)
        np.testing.assert_allclose(system.x[:, 2], [1.0, 2.0, 2.0], atol=1e-9)

    def test_one_place_alone(self, rng):
        """On floats as on arrays."""
        field, x, y = hills(rng), rng.uniform((-2, -2, 1.5), (2, 1, 2), (9, 3)), rng.uniform((-2, -2, -1), (2, 1, 0), (9, 3))
        s, hits = field.crossing(0.0, 1.0, vectors(x), vectors(y))
        for k in range(9):
            one = field.crossing(0.0, 1.0, ap_vec(x[k]), ap_vec(y[k]))
            assert one == (pytest.approx(s[k], abs=1e-12), hits[k])


def ap_vec(x):
    return vectors(np.array([x])).__class__(*(float(c) for c in x))


class TestNothingPassesThrough:
    def test_at_100_metres_a_second(self):
        """Ridges, thinner than the metre that a step takes it; each way ends where it first meets one."""
        heights = np.zeros((5, 41))
        heights[:, 10::10] = 2.0
        field = ap.HeightField(heights, 0.1, (0.0, -0.2, 0.0), restitution=0.5)
        for start in np.linspace(-0.5, 0.7, 13):
            system = ap.System([(start, 0, 0.5)], [(100.0, 0, 0)], colliders=[field])
            for _ in range(6):
                system.step(0.01)
                assert field.gap(0.0, vectors(system.x))[0][0] > -1e-9
                assert system.x[0, 0] < 1.0
            assert system.v[0, 0] < 0.0

    def test_ways_end_where_they_first_meet_it(self, rng):
        """Looked at in four thousand places each."""
        field = hills(rng)
        a, b = rng.uniform((-4, -4, 0), (4, 4, 3), (4000, 3)), rng.uniform((-4, -4, -0.5), (4, 4, 2), (4000, 3))
        a[:500, 2] = height(field, a[:500]) + 1e-9  # these begin on it
        above = a[:, 2] >= height(field, a)
        a, b = a[above], b[above]
        s, hits = field.crossing(0.0, 1.0, vectors(a), vectors(b))
        first = np.full(len(a), np.inf)
        for part in np.linspace(1.0, 0.0, 4001):
            at = a + part * (b - a)
            first[at[:, 2] < height(field, at)] = part
        meets = np.isfinite(first)
        assert 0.3 < meets.mean() < 0.7
        assert hits[meets].all()
        assert not (hits & ~meets & (s > 0.0)).any()
        later = meets & (s > 0.0)
        assert (s[later] <= first[later]).all()
        assert (s[later] >= first[later] - 1.0 / 4000).all()
        at = a + s[:, None] * (b - a)
        assert (at[:, 2] - height(field, at))[hits].max() <= 1.01e-9

    @pytest.mark.parametrize("falling", [0.0, 0.05])
    @pytest.mark.parametrize("above", [1e-9, 1e-3])
    def test_low_over_a_plain_into_a_hill(self, above, falling):
        """A millimetre above it, which is no headway for who knows the gap alone."""
        heights = np.zeros((3, 60))
        heights[:, 50] = 3.0
        field = ap.HeightField(heights, 0.1, (0.0, -0.1, 0.0))
        system = ap.System([(0, 0, above)], [(600.0, 0, -falling)], colliders=[field])
        system.step(0.01)
        assert 4.8 < system.x[0, 0] < 5.0


class TestAsAPlane:
    @pytest.mark.parametrize("angle", [0.0, 0.2, 0.6])
    @pytest.mark.parametrize("solver", ["semi_implicit", "rk4"])
    def test_bounces_sliding_and_rest(self, angle, solver, rng):
        field, plane = slope(angle, restitution=0.4, friction=0.35)
        x, v = rng.uniform((-1, -1, 1), (1, 1, 2), (20, 3)), rng.normal(size=(20, 3))
        one, other = (ap.System(x, v, 1.0, [ap.Gravity(), ap.Drag(0.05)], [thing]) for thing in (field, plane))
        for _ in range(250 if angle < 0.3 else 100):
            one.step(0.01, solver)
            other.step(0.01, solver)
            np.testing.assert_allclose(one.state, other.state, atol=1e-8)
        assert (np.abs(one.v[:, 2]) < 0.1).all() == (angle < 0.3)

    @pytest.mark.parametrize(("angle", "slides"), [(0.28, False), (0.30, True)])
    def test_a_slope_holds_what_its_friction_can(self, angle, slides):
        field, _ = slope(angle, friction=math.tan(0.29))
        system = ap.System([(0, 0, 0)], None, 1.0, [ap.Gravity()], [field])
        system.step(0.01, steps=100)
        expected = 0.5 * G * (math.sin(angle) - math.tan(0.29) * math.cos(angle)) if slides else 0.0
        assert np.linalg.norm(system.x[0]) == pytest.approx(expected, abs=1e-8, rel=1e-6)


@pytest.mark.parametrize("solver", ["semi_implicit", "rk4", "implicit_euler", "xpbd", "adaptive"])
def test_what_falls_on_hills_stays_above_and_comes_to_rest(solver, rng):
    field = hills(rng, 0.4, friction=0.6, restitution=0.2)
    x = rng.uniform((-2, -2, 1), (3.5, 1, 2), (30, 3))
    system = ap.System(x, rng.normal(size=(30, 3)), 1.0, [ap.Gravity(), ap.Drag(0.3)], [field])
    for _ in range(100 if solver == "adaptive" else 300):
        system.step(0.02, solver if solver != "xpbd" else ap.XPBD(4))
        assert np.min(system.x[:, 2] - height(field, system.x)) > -1e-7
    assert np.median(np.abs(system.v)) < 1e-6


def test_what_skims_hills_goes_on(rng):
    """Along the tangent, away from the surface by rounding: it meets nothing before the hill does."""
    field = hills(rng)
    a = rng.uniform((-2, -2, 0), (3, 1, 0), (3000, 3))
    a[:, 2] = height(field, a) + 1e-10
    n = np.stack(list(field.gap(0.0, vectors(a))[1]), axis=1)
    way = rng.normal(size=a.shape)
    way += n * (1e-7 - (n * way).sum(axis=1, keepdims=True))
    s, hits = field.crossing(0.0, 1.0, vectors(a), vectors(a + way))
    passed = np.linspace(0.0, 1.0, 1001)[None] * s[:, None]
    for part in passed.T:
        at = a + part[:, None] * way
        assert (at[:, 2] - height(field, at)).min() > -1e-12
    assert (s[~hits] == 1.0).all()
    assert (s > 1e-3).mean() > 0.4


def test_a_marble_in_a_bowl():
    """Without friction it swings as a pendulum of the radius of curvature there does."""
    line = np.linspace(-1, 1, 81)
    field = ap.HeightField(0.5 * (line[None] ** 2 + line[:, None] ** 2), line[1] - line[0], (-1, -1, 0))
    system = ap.System([(0.05, 0.0, 0.00125 + 1e-4)], None, 1.0, [ap.Gravity()], [field])
    times, h = [], 1e-3
    while len(times) < 2:
        before = system.x[0, 0]
        system.step(h)
        if before * system.x[0, 0] < 0.0:
            times.append(system.time)
    assert times[1] - times[0] == pytest.approx(math.pi / math.sqrt(G), rel=0.01)


def test_with_one_a_system_runs_interpreted(rng):
    field, plane = hills(rng), ap.Plane()
    assert are_alone([], [plane])
    assert not are_alone([], [plane, field])
    springs = ap.Springs([(0, 1)], 1.0)
    assert are_laws([springs], "euler", [plane])
    assert not are_laws([springs], "euler", [plane, field])
    system = ap.System([(0, 0, 3.0), (0, 0.1, 3.0)], None, 1.0, [springs, ap.Gravity()], [field])
    system.step(0.01, steps=200)
    assert np.abs(system.x[:, 2] - height(field, system.x)).max() < 1e-2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.HeightField([1.0, 2.0], 1.0), r"HeightField: heights has shape \(2,\); expected \(n, m\)"),
        (lambda: ap.HeightField([[1.0], [2.0]], 1.0), r"HeightField: heights has shape \(2, 1\); expected two points or more"),
        (lambda: ap.HeightField([[1.0, np.nan]] * 2, 1.0), r"HeightField: heights\[0, 1\] is nan; every entry must be finite"),
        (lambda: ap.HeightField(np.eye(2), 0.0), r"HeightField: spacing is 0.0; expected two positive numbers, along x and y"),
        (lambda: ap.HeightField(np.eye(2), (1.0, 2.0, 3.0)), r"HeightField: spacing has shape \(3,\); expected \(2,\)|\(n,\)"),
        (lambda: ap.HeightField(np.eye(2), 1.0, (0, 0)), r"HeightField: origin has shape \(2,\)"),
        (lambda: ap.HeightField(np.eye(2), 1.0, restitution=2.0), r"HeightField: restitution is 2; expected 0 to 1"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
