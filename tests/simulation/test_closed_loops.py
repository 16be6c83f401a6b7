"""Closed loops in motion: closed forms, published benchmarks, and what holds for every mechanism."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from loop_rigs import bennett, bennett_angles, bricard, car, four_bar, guesses, hands_on_bar, holding_hands, jansen, n_four_bar
from scipy.integrate import solve_ivp

import articulated as art
from articulated.trajectory import Outcome

CRANK, COUPLER, ROCKER, BASE = 0.3, 0.9, 0.7, 1.0
MASSES = (1.0, 2.0, 1.5)
MECHANISMS = list(guesses())


def freudenstein(theta):
    """Angles of coupler and rocker for a crank's angle, which may be complex: Freudenstein 1955."""
    x, z = BASE - CRANK * np.cos(theta), -CRANK * np.sin(theta)
    r2 = x * x + z * z
    r, direction = np.sqrt(r2), np.arctan(z / x)
    coupler = direction + np.arccos((COUPLER**2 + r2 - ROCKER**2) / (2 * COUPLER * r))
    rocker = direction + np.pi - np.arccos((ROCKER**2 + r2 - COUPLER**2) / (2 * ROCKER * r))
    return coupler, rocker


def crank_rocker_state(theta):
    coupler, rocker = freudenstein(theta)
    return np.array([theta, coupler - theta, rocker])


def derivative(f, x, h=1e-30):
    return np.imag(f(x + 1j * h)) / h


def reduced(t, y, g=9.81):
    """θ̈ of the crank: ½ M' θ̇² + M θ̈ + V' = 0, with M and V of the angle alone."""

    def ratios(theta):
        """Of the three links' turning rates and their centres' velocities to the crank's rate, by their derivatives."""
        e = 1e-5  # central differences of sixth order of analytic angles: the outer derivative is a complex step
        steps = np.array([-3, -2, -1, 1, 2, 3])
        weights = np.array([-1, 9, -45, 45, -9, 1]) / 60.0
        angles = [freudenstein(theta + k * e) for k in steps]
        return [sum(w * a[i] for w, a in zip(weights, angles, strict=True)) / e for i in (0, 1)]

    def energies(theta):
        coupler, rocker = freudenstein(theta)
        dc, dr = ratios(theta)
        m1, m2, m3 = MASSES
        mass = m1 * CRANK**2 / 3 + m3 * ROCKER**2 / 3 * dr**2
        cross = CRANK * COUPLER * np.cos(coupler - theta) * dc
        mass = mass + m2 * (CRANK**2 + COUPLER**2 * dc**2 / 3 + cross)
        height = m1 * CRANK / 2 * np.sin(theta) + m3 * ROCKER / 2 * np.sin(rocker)
        height = height + m2 * (CRANK * np.sin(theta) + COUPLER / 2 * np.sin(coupler))
        return mass, g * height

    theta, omega = y
    mass = energies(theta)[0]
    slope = derivative(lambda x: energies(x)[0], theta), derivative(lambda x: energies(x)[1], theta)
    return [omega, -(0.5 * slope[0] * omega**2 + slope[1]) / mass]


def test_four_bar_against_its_reduced_equation():
    q0 = crank_rocker_state(1.0)
    run = art.Simulation(four_bar(), dt=1e-3).run(q0, [3.0, 0, 0], duration=10.0, fps=20)
    omega = run.v[0, 0]  # what is left of the crank's 3 rad/s
    exact = solve_ivp(reduced, (0, 10), [1.0, omega], method="DOP853", rtol=1e-11, atol=1e-11, t_eval=run.time)
    assert np.abs(run.q[:, 0] - exact.y[0]).max() < 1e-6
    assert np.ptp(run.q[:, 0]) > 20.0
    _, rocker = freudenstein(run.q[:, 0])
    np.testing.assert_allclose(np.cos(run.q[:, 2] - rocker), 1.0, atol=1e-12)
    assert run.report.passed


def side_by_side(n):
    """A02 as it starts: all rods turn at 1 rad/s."""
    rig = n_four_bar(n)
    v = np.zeros(rig.nv)
    for name, joint in rig.joints.items():
        v[joint.v_slice] = 1.0 if name.startswith("pivot") else -1.0
    return rig, v


@pytest.mark.sweep
@pytest.mark.parametrize("n", [1, 2, 10, 40])
def test_n_four_bars(n):
    """IFToMM A02: through the horizontal, where for a moment there are n + 1 ways to go. They move as one pendulum."""
    rig, v = side_by_side(n)
    run = art.Simulation(rig, dt=1e-3, integrator="rk4").run(None, v, duration=10.0, fps=20)
    k = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    exact = solve_ivp(
        lambda t, y: [y[1], k * np.sin(y[0])], (0, 10), [0.0, 1.0], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=run.time
    )
    angle = run.q[:, rig.joints["pivot0"].q_slice.start]
    np.testing.assert_allclose(angle, exact.y[0], atol=1e-6)
    assert np.ptp(run.energy) < 1e-8 * run.energy[0]
    assert np.abs(run.loop_gaps).max() < 1e-12
    if n == 40:  # the published curve, of Adams, to its digits: x and y of the first knee
        published = {0.5: (0.687926, 0.725781), 1: (-0.115357, -0.993324), 2: (0.0344663, 0.999406), 10: (0.180513, 0.983573)}
        for t, xy in published.items():
            at = angle[round(20 * t)]
            np.testing.assert_allclose((math.sin(at), math.cos(at)), xy, atol=2e-6)
        assert run.energy[0] == pytest.approx(620.338333, abs=1e-6)


BRICARD = {
    0.0: {0.5: (0.774303, -0.979749, -0.200228), 2.0: (-0.779947, -0.980636, -0.195841), 10.0: (0.999265, -1.0, -0.000735)},
    0.1: {0.5: (0.774718, -0.979815, -0.199906), 2.0: (-0.778135, -0.980353, -0.197253), 10.0: (0.999731, -1.0, -0.000269)},
}
"""Of P3 by Pinocchio, a rod cut in its middle and welded, rk4 with projection, 0.5 ms: thin rods, and such of 0.1 m square."""


@pytest.mark.parametrize("square", BRICARD)
def test_bricard(square):
    """IFToMM A04: five hinges and one more, by whose number nothing could move."""
    rig = bricard(square)
    run = art.Simulation(rig, dt=1e-3, gravity=(0, -9.81, 0)).run(duration=10.0, fps=20)
    for t, expected in BRICARD[square].items():
        p = art.link_poses(rig, run.q[round(20 * t)])[rig.links["rod2"].index, :3, 3]
        np.testing.assert_allclose(p, expected, atol=2e-6)
    assert np.ptp(run.energy) < 1e-9
    assert np.abs(run.loop_gaps).max() < 1e-12


def test_bennett():
    run = art.Simulation(bennett(), dt=1e-3).run(bennett_angles(1.0), [1.0, 0, 0], duration=10.0, fps=20)
    assert np.ptp(run.q[:, 0]) > 1.0
    product = np.tan(0.5 * run.q[:, 0]) * np.tan(0.5 * run.q[:, 1])
    np.testing.assert_allclose(product, product[0], rtol=1e-9)
    np.testing.assert_allclose(run.q[:, 2], -run.q[:, 0], atol=1e-12)
    assert np.ptp(run.energy) < 1e-9


class TestAMinute:
    @pytest.mark.sweep
    def test_crank_rocker(self):
        rig, q0 = four_bar(), crank_rocker_state(1.0)
        run = art.Simulation(rig, dt=1e-3, integrator="rk4").run(q0, [6.0, 0, 0], duration=60.0, fps=10)
        assert np.abs(run.loop_gaps).max() < 1e-9
        assert np.abs(run.energy / run.energy[0] - 1.0).max() < 1e-5

    @pytest.mark.sweep
    def test_crank_rocker_with_the_implicit_step(self):
        rig, q0 = four_bar(), crank_rocker_state(1.0)
        run = art.Simulation(rig, dt=1e-3, integrator="semi_implicit").run(q0, [6.0, 0, 0], duration=60.0, fps=10)
        assert np.abs(run.loop_gaps).max() < 1e-9
        assert (np.diff(run.energy) < 0.02 * np.ptp(run.energy)).all()  # it loses energy, and never blows up
        J = art.loop_jacobian(rig, None, run.q)
        assert np.abs(np.einsum("tij,tj->ti", J, run.v)).max() < 1e-3

    @pytest.mark.sweep
    def test_strandbeest_walks(self):
        """A leg that a motor turns, its frame on a rail: it pushes itself along."""
        rig, q, speed = walking_leg()
        steps = art.Simulation(
            rig,
            dt=1e-3,
            ground=art.Ground(friction=1.0),
            contact_points=[toe()],
            actuation=art.PD({"crank": 2000.0}, {"crank": 40.0}),
        )
        target = np.tile(q, (3600, 1))
        at = rig.joints["crank"].q_slice.start
        target[:, at] = q[at] + speed * (np.arange(3600) + 1) / 60.0
        run = steps.run(q, duration=60.0, fps=60, control=target)
        assert run.report["loop gap"].value < 1e-9
        assert np.abs(run.q[-1, at] - target[-1, at]) < 0.2
        way = run.q[:, rig.joints["rail"].q_slice.start]
        assert abs(way[-1] - way[0]) > 5.0
        assert (np.sign(np.diff(way[::600])) == np.sign(way[-1] - way[0])).all()


def walking_leg():
    builder = art.RigBuilder("walker")
    leg = jansen()
    builder.link("rail")
    for link in leg.links.values():
        mass = 5.0 if link.name == "frame" else link.mass
        inertia = np.eye(3) * 0.1 if link.name == "frame" else link.inertia
        builder.link(link.name, mass, link.center, inertia)
    builder.joint("rail", "prismatic", "rail", "frame", xyz=(0, 0, 0.917), axis=(1, 0, 0), limits=art.Limits(-100.0, 100.0))
    for joint in leg.joints.values():
        builder.joint(joint.name, "continuous", joint.parent, joint.child, pose=joint.pose, axis=joint.axis)
    for loop in leg.loops:
        builder.loop(loop)
    rig = builder.build()
    return rig, rig.neutral(), 3.0


def toe():
    """The foot's lowest corner."""
    return art.ContactPoint("foot", (-0.43160 + 0.26952, 0, -0.91757 + 0.45515), 0.0)


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_mechanism_in_free_motion(name):
    rig, loops, guess = guesses()[name]
    q = art.assemble(rig, loops, guess)
    run = art.Simulation(rig, dt=1e-3, loops=loops, limits=False, integrator="rk4").run(
        q, 0.3 * np.random.default_rng(0).normal(size=rig.nv), duration=0.5, fps=20
    )
    assert np.abs(run.loop_gaps).max() < 1e-9
    damped = np.any(rig.damping > 0.0) or np.any(rig.friction > 0.0)
    drift = np.abs((run.energy - run.energy[0]) - (run.work - run.work[0])).max()
    assert drift < 1e-5 * np.abs(run.kinetic_energy).max()
    assert damped or np.abs(run.work).max() == 0.0
    J = art.loop_jacobian(rig, loops, run.q)
    assert np.abs(np.einsum("tij,tj->ti", J, run.v)).max() < 1e-7 * np.abs(run.v).max()


ON_GROUND = {"bar": 1.4, "hands": 1.4, "car": 0.1, "table": None, "delta": None, "scissor": None, "four bar": None}


@pytest.mark.parametrize("name", ON_GROUND)
def test_mechanisms_on_the_ground(name):
    """Those that fall land and come to rest; those that are mounted just above it hit it with what hangs lowest."""
    rig, loops, guess = guesses()[name]
    q = art.assemble(rig, loops, guess)
    floor, points = 0.0, None
    if ON_GROUND[name] is None:
        X = art.link_poses(rig, q)
        moving = [link for link in rig.links.values() if link.body >= 0 and link.name != "roller"]
        points = [art.ContactPoint(link.name, tuple(link.center)) for link in moving]
        floor = min((X[link.index] @ [*link.center, 1.0])[2] for link in moving) - 0.02
    else:
        for joint in rig.joints.values():
            if joint.kind == "floating" and (not joint.parent or joint.parent == "world"):
                q[joint.q_slice.start + 2] += ON_GROUND[name]
    ground = art.Ground([art.Plane((0, 0, 1), (0, 0, floor))], friction=0.7)
    drives = art.PD(**springs()) if name == "car" else None
    simulation = art.Simulation(rig, dt=1e-3, ground=ground, contact_points=points, loops=loops, actuation=drives)
    run = simulation.run(q, duration=2.0, fps=30)
    assert run.report["loop gap"].value < 1e-8
    assert run.outcome == Outcome.COMPLETED
    assert run.contact_forces[..., 2].max() > 0.0
    assert np.abs(run.contact_gaps[-1]).min() < 0.01


def springs():
    """Of the car's suspension, and its steering wheel held."""
    stiffness = {f"{side}_spring": 2.5e4 for side in ("left", "right")} | {f"{side}_arm": 6e3 for side in ("left", "right")}
    damping = {f"{side}_spring": 2e3 for side in ("left", "right")} | {f"{side}_arm": 4e2 for side in ("left", "right")}
    return {"stiffness": stiffness | {"column": 2e3}, "damping": damping | {"column": 50.0}}


def test_car_steers():
    """The column turned, the rack moves, both wheels turn the same way, and the car leaves its straight line to that side."""
    rig = car()
    q = art.assemble(rig)
    q[2] += 0.02
    simulation = art.Simulation(rig, dt=1e-3, ground=art.Ground(friction=0.9), actuation=art.PD(**springs()))
    v = np.zeros(rig.nv)
    v[0] = 8.0
    for name in ("front_left", "front_right", "rear_left", "rear_right"):
        v[rig.joints[name].v_slice] = 8.0 / 0.3
    target = q.copy()
    target[rig.joints["column"].q_slice] = 2.0
    ends = {}
    for name, control in (("straight", q), ("turned", target)):
        run = simulation.run(q, v, duration=1.5, fps=30, control=control)
        assert run.report["loop gap"].value < 1e-6
        ends[name] = run
    rack, column = (rig.joints[name].q_slice.start for name in ("rack", "column"))
    np.testing.assert_allclose(ends["turned"].q[:, rack], 0.02 * ends["turned"].q[:, column], atol=1e-9)
    assert abs(ends["straight"].q[-1, 1]) < 0.1
    assert abs(ends["turned"].q[-1, 1]) > 0.5
    wheels = art.link_poses(rig, ends["turned"].q[-1])[
        [rig.links[f"{side}_knuckle"].index for side in ("left", "right")], :3, 0
    ]
    body = art.link_poses(rig, ends["turned"].q[-1])[rig.links["chassis"].index, :3, :3]
    angles = [math.atan2(*(body.T @ x)[[1, 0]]) for x in wheels]
    assert angles[0] * angles[1] > 0.0
    assert min(map(abs, angles)) > 0.05


@pytest.mark.parametrize("make", [hands_on_bar, holding_hands])
def test_momentum_of_what_holds_itself(make):
    """No loop pulls its own rig along, nor turns it."""
    rig, loops, guess = make()
    rig = rig.with_joints(damping=0.0, friction=0.0)
    q = art.assemble(rig, loops, guess)
    v = art.project_velocity(rig, loops, q, np.random.default_rng(0).normal(size=rig.nv))
    before = art.momentum(rig, q, v)
    for integrator, allowed in (("rk4", 1e-9), ("semi_implicit", 1e-2)):  # the latter shows velocities a step old
        simulation = art.Simulation(rig, dt=1e-3, gravity=(0, 0, 0), loops=loops, limits=False, integrator=integrator)
        run = simulation.run(q, v, duration=0.3, fps=10)
        after = art.momentum(rig, run.q[-1], run.v[-1])
        np.testing.assert_allclose(after[:3], before[:3], atol=allowed * np.abs(before).max())


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("semi_implicit", 1), ("midpoint", 2), ("rk4", 4)])
def test_orders(integrator, order):
    rig, q0 = four_bar(), crank_rocker_state(1.0)
    exact = art.Simulation(rig, dt=1e-4, integrator="rk4").run(q0, [6.0, 0, 0], duration=0.5, fps=2).q[-1]
    steps = (4e-3, 2e-3, 1e-3) if order > 1 else (1e-3, 5e-4, 2.5e-4)
    errors = []
    for dt in steps:
        run = art.Simulation(rig, dt=dt, integrator=integrator).run(q0, [6.0, 0, 0], duration=0.5, fps=2)
        errors.append(np.abs(run.q[-1] - exact).max())
    measured = np.log2(np.array(errors[:-1]) / errors[1:])
    assert measured.min() > order - 0.3


def test_dopri5_keeps_its_tolerance_and_frames_are_closed():
    rig, q0 = four_bar(), crank_rocker_state(1.0)
    exact = art.Simulation(rig, dt=1e-4, integrator="rk4").run(q0, [6.0, 0, 0], duration=2.0, fps=20)
    errors = []
    for rtol in (1e-5, 1e-7, 1e-9):
        run = art.Simulation(rig, integrator="dopri5", rtol=rtol, atol=rtol).run(q0, [6.0, 0, 0], duration=2.0, fps=20)
        errors.append(np.abs(run.q - exact.q).max())
        assert np.abs(run.loop_gaps).max() < 1e-9
    assert errors[0] < 1e-2
    assert errors[2] < 1e-3 * errors[0]


def test_any_solver_can_have_it():
    rig, q0 = four_bar(), crank_rocker_state(1.0)
    v0 = art.project_velocity(rig, None, q0, [6.0, 0, 0])
    system = art.first_order(rig)
    solution = solve_ivp(system, (0, 2), system.pack(q0, v0), method="DOP853", rtol=1e-10, atol=1e-10)
    q, _ = system.unpack(solution.y[:, -1])
    run = art.Simulation(rig, dt=1e-3).run(q0, v0, duration=2.0, fps=10)
    np.testing.assert_allclose(q, run.q[-1], atol=1e-6)
    with pytest.raises(ValueError, match="is a rope, which only ever pulls"):
        art.first_order(rig, loops=[art.Loop("distance", None, None, "coupler", None, length=1.0, rope=True)])


class TestForces:
    def test_a_weight_on_a_rod(self):
        """A point mass on a slide, hung by a distance: the rod bears its weight."""
        rig = hanging()
        loop = art.Loop("distance", None, (0, 0, 1.0), "weight", None, length=1.0, name="rod")
        for integrator in ("rk4", "semi_implicit"):
            run = art.Simulation(rig, loops=[loop], integrator=integrator).run(duration=0.5, fps=10)
            np.testing.assert_allclose(run.loop_forces[1:, 0], -2.0 * 9.81, rtol=1e-9)
            np.testing.assert_allclose(run.q[:, 2], 0.0, atol=1e-12)
        simulation = art.Simulation(rig, loops=[loop])
        state = simulation.step(simulation.reset())
        np.testing.assert_allclose(simulation.loop_forces(state), [-2.0 * 9.81], rtol=1e-9)

    def test_an_arm_welded_at_both_ends(self):
        """Two welds that repeat each other share what they bear, and the implicit step has no garbage in them."""
        rig, loops, guess = hands_on_bar()
        q = art.assemble(rig, loops, guess)
        twice = [*loops, art.Loop("weld", "person/left_hand", loops[0].pose_a, "bar/bar", loops[0].pose_b, name="glue")]
        runs = [
            art.Simulation(rig, dt=1e-3, loops=some, integrator="semi_implicit").run(q, duration=0.2, fps=20)
            for some in (loops, twice)
        ]
        np.testing.assert_allclose(runs[0].q, runs[1].q, atol=1e-7)
        bound = 10.0 * np.abs(runs[0].loop_forces).max()
        assert np.abs(runs[1].loop_forces).max() < bound


def hanging():
    builder = art.RigBuilder("hanging")
    builder.link("base")
    builder.link("weight", 2.0, (0, 0, 0), (0.01, 0.01, 0.01))
    builder.joint("free", "floating", "base", "weight")
    return builder.build()


class TestRopes:
    ROPE = art.Loop("distance", None, (0, 0, 1.0), "weight", None, length=1.0, rope=True, name="rope")

    def test_is_slack_then_taut(self):
        rig = hanging()
        q = rig.neutral()
        q[2] = 0.5
        run = art.Simulation(rig, dt=1e-3, loops=[self.ROPE]).run(q, duration=3.0, fps=100)
        falling = run.time < math.sqrt(2 * 0.5 / 9.81) - 0.02
        np.testing.assert_allclose(run.q[falling, 2], 0.5 - 0.5 * 9.81 * run.time[falling] ** 2, atol=5e-3)
        assert np.abs(run.loop_forces[falling]).max() == pytest.approx(0.0, abs=1e-6)
        assert run.loop_forces.max() <= 1e-6  # it never pushes
        assert run.loop_gaps.max() < 2e-3
        assert run.loop_forces[-1, 0] == pytest.approx(-2.0 * 9.81, rel=1e-3)
        assert run.report.passed

    def test_swings_like_a_rod(self):
        rig = hanging()
        q = rig.neutral()
        q[:3] = math.sin(0.5), 0.0, 1.0 - math.cos(0.5)
        rod = art.Loop("distance", None, (0, 0, 1.0), "weight", None, length=1.0)
        ends = [
            art.Simulation(rig, dt=1e-3, loops=[loop], integrator="semi_implicit").run(q, duration=2.0, fps=20).q
            for loop in (self.ROPE, rod)
        ]
        np.testing.assert_allclose(ends[0][:, :3], ends[1][:, :3], atol=5e-3)
        smooth = art.Simulation(rig, dt=1e-4, loops=[self.ROPE], integrator="rk4").run(q, duration=2.0, fps=20)
        np.testing.assert_allclose(smooth.q[:, :3], ends[1][:, :3], atol=1e-2)


def test_same_bits_alone_and_in_company():
    rig, loops, guess = hands_on_bar()
    q = np.tile(art.assemble(rig, loops, guess), (21, 1))
    at = rig.joints["person/root_joint"].q_slice.start + 2, rig.joints["bar/root_joint"].q_slice.start + 2
    q[:, at] += np.linspace(1.1, 1.6, 21)[:, None]
    for settings in ({"integrator": "rk4", "limits": False}, {"ground": True}):
        simulation = art.Simulation(rig, dt=2e-3, loops=loops, **settings)
        together = simulation.run(q, duration=0.1, fps=20)
        for some in ([0], [3, 4, 5], list(range(8, 17))):
            apart = simulation.run(q[some], duration=0.1, fps=20)
            for name in ("q", "v", "loop_forces"):
                np.testing.assert_array_equal(getattr(apart, name), getattr(together, name)[some])
        alone = simulation.run(q[20], duration=0.1, fps=20)
        np.testing.assert_array_equal(alone.q, together.q[20])
        one = art.Simulation(rig, dt=2e-3, loops=loops, threads=1, **settings).run(q, duration=0.1, fps=20)
        np.testing.assert_array_equal(one.q, together.q)
        state = simulation.reset(q)
        for _ in range(25):
            state = simulation.step(state)
        assert np.abs(state.q - simulation.run(q, duration=0.05, fps=20).q[:, -1]).max() < 1e-12


def test_float32():
    rig, loops, guess = hands_on_bar()
    q = np.tile(art.assemble(rig, loops, guess), (16, 1)).astype(np.float32)
    for settings in ({"integrator": "rk4", "limits": False}, {}):
        simulation = art.Simulation(rig, dt=2e-3, loops=loops, **settings)
        run = simulation.run(q, np.zeros(rig.nv, np.float32), duration=0.5, fps=20)
        wide = simulation.run(q.astype(float), duration=0.5, fps=20)
        assert simulation.reset(q, np.zeros(rig.nv, np.float32)).q.dtype == np.float32
        assert np.abs(run.loop_gaps).max() < 1e-5
        np.testing.assert_allclose(run.q, wide.q, atol=2e-2)


class TestTrouble:
    def test_open_at_the_start(self):
        with pytest.raises(
            ValueError, match=r"q0 leaves 2 rows of loops open, tip: . by .* m or rad; give it a closed.*art.assemble"
        ):
            art.Simulation(four_bar()).run([1.0, 0.0, 1.0])

    def test_a_rope_too_long_at_the_start(self):
        rope = art.Loop("distance", None, (0, 0, 1.0), "weight", None, length=0.5, rope=True, name="rope")
        with pytest.raises(ValueError, match=r"q0 leaves 1 rows of loops open, rope: rope by 0\.5 m"):
            art.Simulation(hanging(), loops=[rope]).run(hanging().neutral(), duration=0.1)

    def test_a_little_open_is_closed(self):
        q = crank_rocker_state(1.0) + 1e-4
        state = art.Simulation(four_bar()).reset(q)
        assert np.abs(art.loop_gaps(four_bar(), None, state.q)).max() < 1e-9

    def test_contradictory_loops_are_named(self):
        """Two distances that hold together only where the run begins."""
        rig = hanging()
        loops = [
            art.Loop("point", None, (0, 0, 0.0), "weight", None, name="here"),
            art.Loop("point", None, (0, 0, 5e-4), "weight", None, name="there"),
        ]
        run = art.Simulation(rig, loops=loops).run(rig.neutral(), duration=0.1, fps=10)
        assert not run.report.passed
        assert "here: z" in str(run.report)
        assert "there: z" in str(run.report)
        assert "cannot hold together" in run.report["loop gap"].remedy
        assert np.isfinite(run.q).all()

    def test_unknown_things(self):
        rig = four_bar()
        for loop, message in (
            (art.Loop("point", "couplr", None, "rocker", None), "rig 'four bar' has no link 'couplr'; did you mean 'coupler'"),
            (art.Loop("point", "coupler", None, "coupler", (1, 0, 0)), "parts of one rigid body"),
            (art.Loop("weld", None, None, "base", None), "parts of the world"),
            (art.Loop("gear", "j1", None, "j9", None, ratio=1.0), "no moving joint 'j9'"),
            (art.Loop("gear", "j1", None, "j1", None, ratio=1.0), "which no gear can tie to itself"),
        ):
            with pytest.raises(ValueError, match=message):
                art.Simulation(rig, loops=[loop])
            with pytest.raises(ValueError, match=message):
                art.constrained_dynamics(rig, [loop], np.zeros(3), np.zeros(3), np.zeros(3))
        with pytest.raises(ValueError, match="expected a list of loops"):
            art.Simulation(rig, loops=rig.loops[0])
        with pytest.raises(ValueError, match=r"expected an articulated\.Loop"):
            art.Simulation(rig, loops=["tip"])

    def test_a_run_is_saved_with_its_loops(self, tmp_path):
        run = art.Simulation(four_bar(), dt=1e-3).run(crank_rocker_state(1.0), duration=0.2, fps=20)
        run.save(tmp_path / "a.npz")
        again = art.Trajectory.load(tmp_path / "a.npz")
        np.testing.assert_array_equal(again.loop_forces, run.loop_forces)
        assert again.loop_rows == run.loop_rows
        assert str(again.report) == str(run.report)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert [loop.kind for loop in art.load(run.rig.to_urdf()).loops] == ["hinge"]
