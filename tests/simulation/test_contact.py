"""Contact against closed forms: inclines, sliding, rolling, bouncing, resting; stops of joints; drives; what sensors feel."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from contact_rigs import body, chain, on_incline, upright

import articulated as art
from articulated.simulation.implicit import problem

G = 9.81


@pytest.fixture(scope="module")
def box() -> art.Rig:
    return body(art.Box((0.2, 0.2, 0.2)), [1 / 150] * 3)


@pytest.fixture(scope="module")
def ball() -> art.Rig:
    return body(art.Sphere(0.1), [0.004] * 3)


class TestIncline:
    MU = 0.5

    def slide(self, box, ratio, duration, **settings):
        angle = math.atan(ratio * self.MU)
        plane, q = on_incline(box, angle, 0.1 - 1e-4)  # about as deep as it rests
        ground = art.Ground(plane, friction=self.MU)
        run = art.Simulation(box, ground=ground, **settings).run(q, duration=duration, fps=20)
        along = np.array([math.cos(angle), 0.0, math.sin(angle)])
        return angle, run, (run.q[:, :3] - run.q[0, :3]) @ along

    @pytest.mark.parametrize("ratio", [1.005, 1.2, 2.0])
    def test_slides_beyond_the_threshold(self, box, ratio):
        angle, run, _ = self.slide(box, ratio, 3.0, tolerance=1e-6)
        acceleration = np.polyfit(run.time[10:], run.v[10:, 0], 1)[0]
        expected = -G * (math.sin(angle) - self.MU * math.cos(angle))
        assert acceleration == pytest.approx(expected, rel=0.005 if ratio > 1.1 else 0.1)

    @pytest.mark.sweep
    @pytest.mark.parametrize("ratio", [0.5, 0.9, 0.995])
    def test_holds_below_it(self, box, ratio):
        """Not a tenth of a millimetre in a minute: regularised friction alone would creep by centimetres."""
        _, run, moved = self.slide(box, ratio, 60.0)
        settled = moved[60:]  # it lands, and stops: all but free of force if friction is all but too weak
        assert np.abs(settled - settled[0]).max() < 1e-4
        assert np.abs(run.v[-1]).max() < 1e-9

    def test_direction_does_not_matter(self, box):
        mu, speed = 0.4, 2.0
        q, v = upright(box, 0.1 - 1e-4, (3,)), np.zeros((3, 6))
        directions = np.array([[math.cos(a), math.sin(a), 0.0] for a in np.radians([0.0, 30.0, 45.0])])
        v[:, :3] = speed * directions
        run = art.Simulation(box, dt=0.001, ground=art.Ground(friction=mu)).run(q, v, duration=1.5)
        path = run.q[:, -1, :3] - q[:, :3]
        distance = np.einsum("si,si->s", path, directions)
        assert distance == pytest.approx(speed**2 / (2.0 * mu * G), rel=0.01)
        assert distance == pytest.approx(distance[0], rel=1e-9)
        assert np.linalg.norm(path - distance[:, None] * directions, axis=1).max() < 1e-3
        assert np.abs(run.contact_gaps.min(axis=-1)).max() < 3e-4
        assert run.contact_gaps.min(axis=-1).max() < 1e-4  # it does not hover


class TestRolling:
    def test_slides_then_rolls(self, ball):
        mu, speed, radius = 0.3, 2.0, 0.1
        v = np.zeros(6)
        v[0] = speed
        run = art.Simulation(ball, dt=0.0005, ground=art.Ground(friction=mu)).run(upright(ball, 0.1 - 5e-4), v, 0.5, 2000)
        forward = np.gradient(run.q[:, 0], run.time)
        X = art.link_poses(ball, run.q)[:, 0, :3, :3]
        omega = np.einsum("tij,tj->ti", X, run.v[:, 3:])[:, 1]
        slip = forward - omega * radius
        rolls = run.time[np.argmax(slip < 0.005 * speed)]
        assert rolls == pytest.approx(2.0 * speed / (7.0 * mu * G), rel=0.01)
        assert forward[-10] == pytest.approx(5.0 * speed / 7.0, rel=0.005)

    @pytest.mark.parametrize("angle", [0.1, 0.3])
    def test_down_an_incline(self, ball, angle):
        """(5/7) g sin θ, if friction is at least (2/7) tan θ; else it slides too, with g (sin θ − μ cos θ)."""
        for mu, expected in (
            (0.4 * math.tan(angle), 5.0 / 7.0 * G * math.sin(angle)),
            (0.2 * math.tan(angle), 0.8 * G * math.sin(angle)),
        ):
            plane, q = on_incline(ball, angle, 0.1 - 5e-4)
            run = art.Simulation(ball, ground=art.Ground(plane, friction=mu), tolerance=1e-6).run(q, duration=1.0, fps=50)
            along = np.array([math.cos(angle), 0.0, math.sin(angle)])
            x = (run.q[:, :3] - q[:3]) @ along
            acceleration = 2.0 * np.polyfit(run.time[5:], x[5:], 2)[0]
            assert -acceleration == pytest.approx(expected, rel=0.005)

    def test_a_wheel_rolls_smoothly(self):
        """A cylinder on its side, its lowest rim points under it all the time."""
        wheel = body(art.Cylinder(0.3, 0.1), [0.03, 0.03, 0.045])
        q, v = upright(wheel, 0.3 - 5e-4), np.zeros(6)
        q[3:] = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # its axis along −y
        v[0], v[5] = 3.0, -10.0
        run = art.Simulation(wheel, ground=True).run(q, v, 2.0)
        assert run.q[-1, 0] == pytest.approx(6.0, rel=0.005)
        assert np.ptp(run.q[5:, 2]) < 1e-5
        assert run.report

    def test_a_cylinder_stands_on_its_end(self):
        drum = body(art.Cylinder(0.1, 0.2), [0.01, 0.01, 0.005])
        run = art.Simulation(drum, ground=True).run(upright(drum, 0.12), duration=1.0)
        assert np.abs(run.v[-1]).max() < 1e-6
        assert run.q[-1, 2] == pytest.approx(0.1, abs=1e-3)


class TestBounce:
    @pytest.fixture(scope="class")
    @staticmethod
    def bounces(ball):
        runs = {}
        for e in (0.3, 0.6, 0.9):
            total = math.sqrt(2.0 / G) * (1.0 + e) / (1.0 - e)
            simulation = art.Simulation(ball, dt=0.001, ground=art.Ground(restitution=e))
            runs[e] = total, simulation.run(upright(ball, 1.1), duration=1.1 * total, fps=1000)
        return runs

    @pytest.mark.parametrize(("e", "count"), [(0.3, 3), (0.6, 8), (0.9, 30)])
    def test_heights_and_time(self, bounces, e, count):
        total, run = bounces[e]
        z, v = run.q[:, 2] - 0.1, run.v[:, 2]
        up = np.flatnonzero((v[1:] > 0.0) & (v[:-1] < 0.0))
        peaks = [z[a:b].max() for a, b in pairwise(up[: count + 1])]
        assert peaks == pytest.approx([e ** (2 * (n + 1)) for n in range(count)], rel=0.02)
        ends = run.time[np.flatnonzero(z > 1e-4)[-1]]
        assert ends == pytest.approx(total, rel=0.02)

    def test_relation_of_hunt_and_crossley(self, ball):
        """ln[(1 + d v)/(1 − d e v)] = d v (1 + e) between dissipation, speed and rebound, without any restitution."""
        d, speed = 0.4, 1.0
        ground = art.Ground(stiffness=1e4, dissipation=d)
        v = np.zeros(6)
        v[2] = -speed
        for settings in ({"integrator": "dopri5", "rtol": 1e-9}, {"dt": 2e-6}):
            simulation = art.Simulation(ball, gravity=(0.0, 0.0, 0.0), ground=ground, **settings)
            e = simulation.run(upright(ball, 0.1001), v, duration=0.06, fps=100).v[-1, 2] / speed
            assert math.log((1 + d * speed) / (1 - d * e * speed)) == pytest.approx(d * speed * (1 + e), abs=1e-3)
            assert 0.7 < e < 0.8

    @pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
    def test_never_gains(self, box, e):
        """A tumbling cube, on one corner or on eight: its energy, velocities taken in mid-step, rises by rounding of order h."""
        rng, h = np.random.default_rng(0), 0.001
        q, v = upright(box, 1.0, (64,)), rng.normal(size=(64, 6))
        q[:, 3:] = rng.normal(size=(64, 4))
        q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1, keepdims=True)
        v[:, 3:] *= 5.0
        run = art.Simulation(box, dt=h, ground=art.Ground(restitution=e, friction=0.8)).run(q, v, 1.5, 1000)
        X = art.link_poses(box, run.q)[..., 0, :3, :3]
        centred = run.v.copy()
        centred[..., :3] += np.einsum("stji,j->sti", X, [0.0, 0.0, -0.5 * G * h])
        energy = art.kinetic_energy(box, run.q, centred) + art.potential_energy(box, run.q)
        rise = (energy - np.minimum.accumulate(energy, axis=1)).max(axis=1)
        assert (rise / energy[:, 0]).max() < 0.005
        assert (energy[:, -1] < 1.005 * energy[:, 0]).all()


class TestForces:
    def test_weight(self, box):
        run = art.Simulation(box, ground=True).run(upright(box, 0.1), duration=1.0)
        assert run.contact_forces[-1].sum(axis=0) == pytest.approx([0.0, 0.0, G], rel=1e-6, abs=1e-6)
        couple = np.cross(run.contact_points[-1] - run.q[-1, :3], run.contact_forces[-1]).sum(axis=0)
        assert couple == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
        assert run.contact_normals[-1].tolist() == [[0.0, 0.0, 1.0]] * 8

    def test_impulse_is_change_of_momentum(self):
        """Step by step, to rounding: with momenta of the configuration that a step starts from, as it sees them."""
        rig = art.load("ragdoll", root="free")
        simulation = art.Simulation(rig, ground=True, limits=False)
        q = upright(rig, 1.1)
        state = simulation.reset(q, 0.5 * np.random.default_rng(0).normal(size=rig.nv))
        pushed = 0
        q_old = q
        for _ in range(300):
            new = simulation.step(state)
            force = simulation.contacts(new).forces.sum(axis=0)
            before, after = self.momentum(rig, q_old, state), self.momentum(rig, state.q, new)
            expected = before + 0.002 * (force + rig.mass * np.array(art.GRAVITY))
            np.testing.assert_allclose(after, expected, atol=1e-11)
            pushed += force[2] > 0.0
            q_old, state = state.q, new
        assert pushed > 100

    @staticmethod
    def momentum(rig, q, state):
        """Of these velocities at another configuration; a free root's are the same in the world."""
        v = state.v.copy()
        R_then, R_now = (art.link_poses(rig, x)[0, :3, :3] for x in (q, state.q))
        v[:3] = R_then.T @ R_now @ v[:3]
        return art.momentum(rig, q, v)[:3]

    def test_free_fall_is_that_without_ground(self, rng):
        rig = art.load("ragdoll", root="free").with_joints(damping=0.1)
        q, v = rig.random(rng, 16), rng.normal(size=(16, rig.nv))
        q[:, 2] = 100.0
        alone, above = (art.Simulation(rig, ground=ground, limits=False).run(q, v, 0.5) for ground in (None, True))
        assert alone.q.tobytes() == above.q.tobytes()
        assert alone.v.tobytes() == above.v.tobytes()

    def test_conveyor(self, box):
        """It takes what stands on it along."""
        ground = art.Ground(friction=0.5, velocity=(1.0, 0.0, 0.0))
        run = art.Simulation(box, ground=ground).run(upright(box, 0.1), duration=1.0)
        assert run.v[-1, 0] == pytest.approx(1.0, abs=1e-3)
        meets = run.time[np.argmax(run.v[:, 0] > 0.99)]
        assert meets == pytest.approx(1.0 / (0.5 * G), abs=0.03)

    def test_pushes(self, box):
        """An external force on a link: less than friction holds, then more."""
        wrench = np.zeros((2, 1, 6))
        wrench[:, 0, 0] = [0.8 * 0.5 * G, 1.2 * 0.5 * G]
        run = art.Simulation(box, ground=art.Ground(friction=0.5)).run(
            upright(box, 0.0999, (2,)), duration=1.0, external=wrench
        )
        assert abs(run.q[0, -1, 0]) < 1e-3
        assert run.q[1, -1, 0] == pytest.approx(0.5 * 0.2 * 0.5 * G, rel=0.05)

    def test_touching(self, box):
        simulation = art.Simulation(box, ground=True)
        state = simulation.reset(upright(box, 0.2))
        assert not simulation.contacts(state).touching.any()
        for _ in range(200):
            state = simulation.step(state)
        contacts = simulation.contacts(state)
        assert contacts.touching.sum() == 4
        assert contacts.on("body")[2] == pytest.approx(G, rel=1e-3)
        with pytest.raises(ValueError, match="link 'head' has no point of contact; there are some on body"):
            contacts.on("head")


class TestReach:
    """Points and stops that nothing can bring together in a step have no part in it."""

    def test_nothing_is_missed(self, monkeypatch, rng):
        """Falling chains, as if all were looked at: not a bit is different."""
        monkeypatch.setenv("ARTICULATED_CACHE", "off")
        q, v = chain(6).random(rng, 64), rng.normal(size=(64, chain(6).nv))
        q[:, 2] = rng.uniform(0.1, 0.5, 64)
        ends = []
        for reach in (10.0, 1e9):
            monkeypatch.setattr(problem, "REACH", reach)
            monkeypatch.setattr(problem, "REACH_OF_STOPS", 5.0 * reach)
            run = art.Simulation(chain(6), ground=True).run(q, v, duration=1.0)
            assert (np.linalg.norm(run.contact_forces, axis=-1) > 0.0).any(axis=(0, 1)).all()
            ends.append(np.concatenate([run.q, run.v, run.contact_forces.reshape(*run.q.shape[:2], -1)], axis=-1))
        np.testing.assert_array_equal(*ends)

    @pytest.mark.parametrize("speed", [5.0, 50.0, 500.0])
    def test_what_comes_fast_is_met(self, ball, speed):
        v = np.zeros((20, 6))
        v[:, 2] = -speed
        q = upright(ball, 0.0, (20,))
        q[:, 2] = 1.0 + np.linspace(0.0, 0.002 * speed, 20)  # it meets the ground at any time within a step
        run = art.Simulation(ball, ground=art.Ground(stiffness=1e9), dt=0.002).run(q, v, duration=0.3 + 1.0 / speed, fps=500)
        fastest = np.hypot(speed, np.sqrt(2.0 * G))
        assert run.contact_gaps.min() > -1.1 * fastest * 0.002 / (2 * np.pi) - 1e-3  # a spring with the period of a step
        assert np.abs(run.v[:, -1, 2]).max() < 0.2  # it has stopped, or hops by millimetres


def pendulum(lower, upper, **properties) -> art.Rig:
    builder = art.RigBuilder("door")
    builder.link("frame")
    builder.link("door", 1.0, (0.5, 0.0, 0.0), np.diag([0.01, 0.01, 0.01]))
    builder.joint("hinge", "revolute", "frame", "door", axis=(0, 1, 0), limits=art.Limits(lower, upper))
    return builder.build().with_joints(**properties)


class TestStops:
    @pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
    def test_restitution(self, e):
        """A bar falls on its stop: speeds before and after."""
        rig = pendulum(-2.0, 0.0)
        run = art.Simulation(rig, dt=0.0005, limits=art.Stops(restitution=e, dissipation=50.0)).run(
            [-0.5], duration=0.9, fps=2000
        )
        v = run.v[:, 0]
        k = int(np.argmax(v))
        assert v[k] > 1.0
        assert v[k : k + 60].min() == pytest.approx(-e * v[k], rel=0.02, abs=0.02)

    def test_bursts_of_torque(self, rng):
        """Whatever pushes, no limit is left by more than the stop gives: f/m (T/2π)², and v T/2π of an impact."""
        rig, stops, h = pendulum(-0.5, 0.5, damping=0.1), art.Stops(), 0.002
        inertia, period = art.mass_matrix(rig, [0.0])[0, 0], max(stops.period, h)
        torque = rng.uniform(-50.0, 50.0, (1000, 100, 1))
        run = art.Simulation(rig, dt=h, limits=stops).run(
            rng.uniform(-0.5, 0.5, (1000, 1)), duration=1.0, fps=100, control=torque
        )
        beyond = np.abs(run.q).max() - 0.5
        speed = np.abs(run.v).max()
        assert beyond < (50.0 + 0.5 * G) / inertia * (period / (2 * np.pi)) ** 2 + speed * period / (2 * np.pi)
        assert run.report["limit violation"].value == pytest.approx(beyond)

    def test_a_locked_joint_does_not_jitter(self):
        run = art.Simulation(pendulum(0.3, 0.3)).run([0.3], duration=2.0)
        assert np.abs(run.v[10:]).max() < 1e-9
        assert np.abs(run.q - 0.3).max() < 1e-3

    def test_ball_joint(self):
        """It leans against the rim of its cone."""
        builder = art.RigBuilder("arm")
        builder.link("post")
        builder.link("arm", 1.0, (0.0, 0.0, 0.5), np.diag([0.01, 0.01, 0.01]))
        builder.joint("shoulder", "ball", "post", "arm", limits=art.Limits(upper=0.7))
        rig = builder.build().with_joints(damping=0.5)
        start = np.array([math.sin(0.05), 0.0, 0.0, math.cos(0.05)])
        run = art.Simulation(rig).run(start, duration=3.0)
        angle = 2.0 * np.arctan2(np.linalg.norm(run.q[-1, :3]), run.q[-1, 3])
        assert angle == pytest.approx(0.7, abs=2e-3)
        assert np.abs(run.v[-1]).max() < 1e-4


class TestDrives:
    def test_a_very_stiff_drive_is_stable_in_contact(self):
        """1e6 N m/rad at 5 ms: MuJoCo's explicit drives diverge there."""
        rig = art.load("ragdoll", root="free")
        drives = art.PD(stiffness=1e6, damping=1e3)
        run = art.Simulation(rig, dt=0.005, ground=True, limits=False, actuation=drives).run(upright(rig, 1.3), duration=3.0)
        assert (run.outcome == art.Outcome.COMPLETED).all()
        assert np.abs(run.v[-1, 6:]).max() < 1e-2
        assert np.abs(art.difference(rig, run.q[-1], run.q[0])[6:]).max() < 2e-3

    def test_torque_limits_are_kept(self):
        rig = art.load("ragdoll", root="free")
        drives = art.PD(stiffness=1e4, damping=50.0, limit=20.0)
        run = art.Simulation(rig, ground=True, actuation=drives).run(upright(rig, 1.2), duration=1.0)
        assert np.abs(run.tau).max() == 20.0
        assert (np.abs(run.tau[..., 6:]) < 20.0).any()
        assert not run.tau[..., :6].any()

    def test_law(self):
        """p (target − q) − d v at the end of each step, to the last step."""
        rig = pendulum(-3.0, 3.0)
        simulation = art.Simulation(rig, actuation=art.PD(stiffness=7.0, damping=0.3))
        run = simulation.run([0.1], duration=0.5, fps=500, control=[0.4])
        expected = 7.0 * (0.4 - run.q[1:]) - 0.3 * run.v[1:]
        np.testing.assert_allclose(run.tau[1:], expected, atol=1e-9)

    def test_gains_by_joint_and_by_state(self):
        rig = art.load("ragdoll", root="free")
        left = art.PD(stiffness={"left_knee": 50.0}, damping={"left_knee": 5.0})
        run = art.Simulation(rig, actuation=left).run(duration=0.1)
        assert np.flatnonzero(run.tau.any(axis=0)).tolist() == list(range(*rig.joints["left_knee"].v_slice.indices(rig.nv)))
        gains = np.zeros((2, rig.nv))
        gains[1, 6:] = 100.0
        target = rig.neutral()
        target[rig.joints["left_knee"].q_slice] = 1.0
        run = art.Simulation(rig, actuation=art.PD(gains)).run(np.tile(rig.neutral(), (2, 1)), duration=0.1, control=target)
        assert not run.tau[0].any()
        assert run.tau[1].any()


class TestSmooth:
    """Ground for methods that look for a smooth right side."""

    def test_methods_agree(self, ball):
        v = np.zeros(6)
        v[0] = 0.5
        ground = art.Ground(stiffness=2e3, dissipation=1.0, friction=0.2)
        ends = [
            art.Simulation(ball, ground=ground, **settings).run(upright(ball, 0.15), v, 0.5, 10).q[-1]
            for settings in ({"integrator": "dopri5", "rtol": 1e-9}, {"integrator": "rk4", "dt": 1e-4}, {"dt": 2e-5})
        ]
        assert ends[1] == pytest.approx(ends[0], abs=5e-6)
        assert ends[2] == pytest.approx(ends[0], abs=1e-3)

    def test_order_of_rk4_in_contact(self, ball):
        """Inside the ground from beginning to end, so that nothing is crossed."""
        ground = art.Ground(stiffness=500.0, dissipation=0.1, friction=0.0)
        q = upright(ball, 0.08)
        ends = [
            art.Simulation(ball, dt=dt, integrator="rk4", ground=ground).run(q, duration=0.05, fps=20).q[-1, 2]
            for dt in (5e-3, 2.5e-3, 1.25e-3)
        ]
        assert np.log2((ends[0] - ends[1]) / (ends[1] - ends[2])) == pytest.approx(4.0, abs=0.3)

    def test_stops_and_drives(self):
        rig = pendulum(-0.5, 0.5, damping=0.05)
        drives = art.PD(stiffness=20.0, damping=1.0, limit=3.0)
        ends = [
            art.Simulation(rig, limits=art.Stops(period=0.1), actuation=drives, **settings)
            .run([0.0], duration=1.0, fps=10, control=[-0.4])
            .q[-1]
            for settings in ({"integrator": "dopri5"}, {"dt": 2e-5})
        ]
        assert ends[1] == pytest.approx(ends[0], abs=1e-3)


class TestConvergence:
    @pytest.fixture(scope="class")
    @staticmethod
    def falls():
        """A stiff doll falls on its feet and over: 0.25 s in the air, then 0.35 s on the ground, at halved steps."""
        rig = art.load("ragdoll", root="free")
        drives = art.PD(stiffness=300.0, damping=20.0)
        ground = art.Ground(friction=0.6, stiffness=2e5, dissipation=5.0)
        q = upright(rig, 1.35)
        q[3:7] = [math.sin(0.1), 0.0, 0.0, math.cos(0.1)]
        v = np.zeros(rig.nv)
        v[5], v[8], v[12] = 1.0, 2.0, -3.0
        runs = {}
        for n in (1, 2, 4, 8):
            simulation = art.Simulation(rig, dt=0.002 / n, ground=ground, actuation=drives, limits=False, tolerance=1e-7)
            runs[n] = simulation.run(q, v, 0.6, 500)
        return rig, runs

    def test_before_the_first_impact(self, falls):
        """Of order 1: half the step, half the error."""
        rig, runs = falls
        air = int(np.argmax(runs[8].contact_gaps.min(axis=1) < 0.0)) - 2
        assert air > 80
        ends = [runs[n].q[air] for n in (1, 2, 4, 8)]
        errors = [np.linalg.norm(art.difference(rig, a, b)) for a, b in pairwise(ends)]
        assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2)
        assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.2)

    def test_after_it(self, falls):
        """Halved steps agree better and better with each other."""
        rig, runs = falls
        errors = [np.abs(art.difference(rig, runs[a].q, runs[2 * a].q)).max() for a in (1, 2, 4)]
        assert errors[2] < errors[0]
        assert errors[2] < 0.05

    def test_laws_of_contact(self, falls):
        """How far each law is missed, by itself: Signorini's, Coulomb's and that of maximum dissipation.

        After Le Lidec et al. 2023, "Contact models in robotics: a comparative study". Forces and velocities are those of a step.
        """
        rig, runs = falls
        for n, run in runs.items():
            force, normal = run.contact_forces[1:], run.contact_normals[1:]
            push = np.einsum("tci,tci->tc", force, normal)
            rub = force - push[..., None] * normal
            weight = G * rig.mass
            signorini = np.minimum(np.maximum(run.contact_gaps[1:], 0.0), push / weight).max()  # [m], force over weight
            coulomb = np.maximum(np.linalg.norm(rub, axis=-1) - 0.6 * np.maximum(push, 0.0), 0.0).max() / weight
            velocity, X = art.link_velocities(rig, run.q[1:], run.v[1:]), art.link_poses(rig, run.q[1:])
            which = [rig.links[name].index for name in run.contact_links]
            arm = run.contact_points[1:] - X[:, which][..., :3, 3]
            slip = velocity[:, which, :3] + np.cross(velocity[:, which, 3:], arm)
            slip -= np.einsum("tci,tci->tc", slip, normal)[..., None] * normal
            slides = (np.linalg.norm(slip, axis=-1) > 0.1) & (push > 0.02 * weight)
            opposed = np.einsum("tci,tci->tc", slip, rub) / np.maximum(
                np.linalg.norm(slip, axis=-1) * np.linalg.norm(rub, axis=-1), 1e-12
            )
            assert slides.any()
            assert opposed[slides].max() < -0.9
            assert push.min() > -1e-6 * weight
            assert signorini < 2e-3
            assert coulomb < 0.15 / n + 0.02
