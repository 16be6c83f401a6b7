"""What follows motions: a walk with a helping hand, pushed, gone limp, and back; modes of joints; pushes; reaching; standing."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import articulated as art

WALK = Path(__file__).parents[1] / "data" / "cmu_12_01_walk.bvh"


def errors(motion: art.Motion, run: art.Trajectory) -> np.ndarray:
    """How far each ball joint is from where it should be, shape (joints, ..., T) [degrees]."""
    wanted = motion.at(run.time)
    found = []
    for joint in motion.rig.joints.values():
        if joint.kind == "ball":
            dots = np.abs(np.sum(run.q[..., joint.q_slice] * wanted[:, joint.q_slice], axis=-1))
            found.append(2.0 * np.arccos(np.clip(dots, 0.0, 1.0)))
    return np.degrees(found)


@pytest.fixture(scope="module")
def walk() -> art.Motion:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", art.RigWarning)
        _, motion = art.from_bvh(WALK)
    return art.grounded(motion.part(0.1))


@pytest.fixture(scope="module")
def simulation(walk) -> art.Simulation:
    drives = art.tuned(walk.rig, frequency=6.0, limit=400.0, help=3.0)
    return art.Simulation(walk.rig, dt=0.005, ground=True, actuation=drives)


def tracked(
    simulation: art.Simulation, walk: art.Motion, tracker: art.Tracker, states: int = 4, duration: float = 4.1, **options
):
    return simulation.run(np.tile(walk.q[0], (states, 1)), walk.v[0], duration=duration, fps=30, control=tracker, **options)


@pytest.mark.sweep
class TestWalk:
    def test_helped_and_pushed(self, simulation, walk):
        """The first of four is left alone; the others are pushed, six times, with 300 N for 0.1 s."""
        pushes, rng = art.Pushes(walk.rig), np.random.default_rng(0)
        for k, link in enumerate(["Spine1", "Head", "LeftArm", "RightArm", "LeftUpLeg", "Hips"]):
            force = rng.normal(size=(4, 3))
            force *= 300.0 / np.linalg.norm(force, axis=-1, keepdims=True)
            force[0] = 0.0
            pushes.add(link, force, start=0.5 + 0.6 * k, duration=0.1)
        run = tracked(simulation, walk, art.Tracker(simulation, walk), external=pushes)
        mean = errors(walk, run).mean(axis=(0, 2))
        assert mean[0] < 2.0
        assert mean.max() < 5.0
        assert np.abs(run.tau[..., 6:]).max() <= 400.0
        assert np.abs(run.tau[0, :, 6:]).max() < 300.0
        assert np.abs(run.q[..., :3] - walk.at(run.time)[:, :3]).max() < 0.1
        assert run.report["penetration"].passed
        assert run.report["solver residual"].passed

    def test_without_help_it_falls_and_lies_within_its_limits(self, simulation, walk):
        tracker = art.Tracker(simulation, walk)
        tracker.set("limp", at=0.5)
        run = tracked(simulation, walk, tracker, duration=7.0)
        assert run.q[:, -1, 2].max() < 0.35
        assert run.kinetic_energy[:, -1].max() < 0.1
        last = art.Motion(walk.rig, run.q[0, -2:], 30.0)
        assert max(art.audit(last).violations.values(), default=0.0) < np.radians(1.0)
        np.testing.assert_array_equal(run.tau[:, 20:], 0.0)

    def test_it_falls_and_gets_its_pose_back(self, simulation, walk):
        """Limp, pushed, lying; then helped up from where it lies, and on with the walk."""
        tracker = art.Tracker(simulation, walk)
        tracker.set("limp", at=0.5, over=0.1)
        tracker.aim(walk, at=3.0, over=1.5, here=True)
        tracker.set("driven", at=3.0, over=1.0)
        pushes = art.Pushes(walk.rig)
        pushes.add("Spine1", (300.0, 0.0, 0.0), start=0.5, duration=0.1)
        run = tracked(simulation, walk, tracker, duration=6.5, external=pushes)
        assert run.q[0, 90, 2] < 0.35
        late = run.time > 5.0
        wanted = walk.at(run.time[late] - 3.0)
        elbow = walk.rig.joints["LeftForeArm"].q_slice
        assert np.degrees(np.arccos(np.abs(np.sum(run.q[0, late][:, elbow] * wanted[:, elbow], axis=-1)))).mean() < 5.0
        np.testing.assert_allclose(run.q[0, late, 2], wanted[:, 2], atol=0.05)
        assert np.linalg.norm(run.q[0, late, :2] - wanted[:, :2], axis=-1).min() > 0.1  # it goes on from where it lay

    def test_prescribed_joints_follow_exactly(self, simulation, walk):
        tracker = art.Tracker(simulation, walk)
        tracker.set("prescribed", ["LeftArm", "LeftForeArm", "root_joint"])
        run = tracked(simulation, walk, tracker, duration=1.0)
        wanted = walk.at(run.time)
        for name in ("LeftArm", "LeftForeArm", "root_joint"):
            part = walk.rig.joints[name].q_slice
            assert np.abs(run.q[0, :, part] - wanted[:, part]).max() < 1e-3

    def test_part_of_it_may_be_limp(self, simulation, walk):
        tracker = art.Tracker(simulation, walk)
        tracker.set("limp", "RightArm")
        run = tracked(simulation, walk, tracker, duration=1.0)
        part = walk.rig.joints["RightArm"].v_slice
        np.testing.assert_array_equal(run.tau[..., part], 0.0)
        assert np.abs(run.tau[:, 1:, walk.rig.joints["LeftArm"].v_slice]).max() > 0.1


class TestHolding:
    @pytest.fixture(scope="class")
    @classmethod
    def stiff(cls) -> art.Simulation:
        rig = art.load("ragdoll", root="free")
        return art.Simulation(rig, dt=0.005, ground=True, actuation=art.PD(1e6, 1e3))

    def test_a_pose_at_any_gain(self, stiff):
        """At a million N m/rad, in contact: falls over stiff as a board, and stays as it is to five milliradians."""
        rig = stiff.rig
        q = rig.neutral()
        q[2] = 1.0
        q[rig.joints["left_knee"].q_slice] = q[rig.joints["right_elbow"].q_slice] = 0.8
        v = np.zeros(rig.nv)
        v[0] = 1.0
        run = stiff.run(q, v, duration=4.0, control=q)
        away = art.difference(rig, q, run.q)[:, 6:]
        assert np.abs(away).max() < 5e-3
        assert np.isfinite(run.q).all()
        assert run.kinetic_energy[-1] < 1.0
        assert run.contact_forces[-1].sum(axis=0)[2] == pytest.approx(rig.mass * 9.81, rel=0.1)

    def test_explicit_drives_blow_up_there(self, stiff):
        rig = stiff.rig
        q = rig.neutral()
        q[2] = 1.0

        def torques(t, state):
            tau = -1e6 * art.difference(rig, q, state.q) - 1e3 * state.v
            tau[..., :6] = 0.0
            return np.clip(tau, -1e30, 1e30)

        start = q.copy()
        start[rig.joints["left_knee"].q_slice] = 0.01
        plain = art.Simulation(rig, dt=0.005, ground=True)
        state, largest = plain.reset(start), 0.0
        with np.errstate(all="ignore"):
            for _ in range(40):
                if not np.abs(state.v).max() < 1e4:
                    break
                state = plain.step(state, torques)
                largest = max(largest, float(np.nan_to_num(np.abs(state.v).max(), nan=np.inf)))
        assert largest > 1e3  # rad/s, from a hundredth of a radian


class TestTracker:
    @pytest.fixture(scope="class")
    @classmethod
    def arm(cls) -> art.Simulation:
        builder = art.RigBuilder("arm")
        builder.link("base")
        builder.link("upper", 1.0, (0, 0, -0.2), (0.02, 0.02, 0.01))
        builder.link("lower", 1.0, (0, 0, -0.2), (0.02, 0.02, 0.01))
        builder.joint("shoulder", "ball", "base", "upper")
        builder.joint("elbow", "revolute", "upper", "lower", xyz=(0, 0, -0.4), axis=(0, 1, 0))
        rig = builder.build()
        return art.Simulation(rig, dt=0.005, gravity=(0, 0, 0), actuation=art.tuned(rig, 3.0))

    def swing(self, rig: art.Rig) -> art.Motion:
        t = np.arange(121) / 60.0
        q = np.tile(rig.neutral(), (len(t), 1))
        q[:, 4] = np.sin(3.0 * t)
        return art.Motion(rig, q, 60.0)

    def test_velocities_are_followed(self, arm):
        """A drive that knows how fast its target moves lags behind far less than one that does not."""
        motion = self.swing(arm.rig)
        lag = {}
        for known in (True, False):
            run = arm.run(motion.q[0], motion.v[0], duration=2.0, control=art.Tracker(arm, motion, velocity=known))
            lag[known] = np.abs(run.q[:, 4] - motion.at(run.time)[:, 4]).max()
        assert lag[True] < 0.25 * lag[False]

    def test_strengths_take_their_time(self, arm):
        tracker = art.Tracker(arm, arm.rig.neutral())
        tracker.set(0.25, "elbow", at=1.0, over=1.0)
        asked = []
        arm.run(duration=2.5, fps=50, control=lambda t, s: asked.append(tracker(t, s)) or asked[-1])
        own = np.array([command.stiffness[3] for command in asked]) / asked[0].stiffness[3]
        others = np.array([command.stiffness[0] for command in asked])
        assert (own[:200] == 1.0).all()
        assert own[300] == pytest.approx(0.625, abs=0.02)
        np.testing.assert_allclose(own[405:], 0.25)
        assert (others == others[0]).all()

    def test_a_pose_after_a_motion(self, arm):
        rig, motion = arm.rig, self.swing(arm.rig)
        pose = rig.neutral()
        pose[4] = -0.7
        tracker = art.Tracker(arm, motion)
        tracker.aim(pose, at=1.0, over=0.3)
        run = arm.run(motion.q[0], motion.v[0], duration=3.0, control=tracker)
        assert run.q[-1, 4] == pytest.approx(-0.7, abs=1e-3)
        assert np.abs(np.diff(run.v[:, 3])).max() < 2.5

    def test_over_and_over(self, arm):
        motion = self.swing(arm.rig).part(0.0, 2.0)
        run = arm.run(motion.q[0], motion.v[0], duration=3.0, control=art.Tracker(arm, motion, loop=True))
        assert np.isfinite(run.q).all()
        assert abs(run.q[150, 4] - motion.at(0.5)[4]) < 0.3

    def test_errors(self, arm):
        rig = arm.rig
        tracker = art.Tracker(arm, rig.neutral())
        for call, message in (
            (lambda: tracker.set("lazy"), "mode is 'lazy'; expected limp, driven, prescribed, or a strength from 0 to 1"),
            (lambda: tracker.set(2.0), r"mode is 2\.0; expected"),
            (lambda: tracker.set("limp", "knee"), "rig 'arm' has no moving joint 'knee'"),
            (lambda: tracker.set("limp", over=-1.0), "expected seconds, zero or more"),
            (lambda: tracker.aim(np.zeros(3)), r"pose has shape \(3,\)"),
            (lambda: art.Tracker(art.Simulation(rig), rig.neutral()), "the simulation has no drives to track a motion with"),
            (
                lambda: art.Tracker(arm, art.Motion(art.load("pendulum"), np.tile([0, 0, 0, 1.0], (3, 2)), 1.0)),
                "the motion is of rig 'pendulum'; expected one of rig 'arm'",
            ),
        ):
            with pytest.raises(ValueError, match=message):
                call()


class TestGains:
    @pytest.mark.parametrize(("ratio", "wanted"), [(0.1, 0.1), (0.3, 0.3)])
    def test_they_are_oscillators(self, ratio, wanted):
        """One hinge swings at the frequency asked for, and loses what the damping ratio says."""
        builder = art.RigBuilder("wheel")
        builder.link("base")
        builder.link("wheel", 1.0, inertia=(0.2, 0.2, 0.3))
        builder.joint("axle", "continuous", "base", "wheel", axis=(0, 0, 1))
        rig = builder.build()
        run = art.Simulation(rig, dt=1e-4, actuation=art.tuned(rig, 2.0, ratio)).run(
            [0.5], duration=1.5, fps=1000, control=[0.0]
        )
        t, w = run.time, 2.0 * np.pi * 2.0
        damped = w * np.sqrt(1.0 - wanted**2)
        exact = 0.5 * np.exp(-wanted * w * t) * (np.cos(damped * t) + wanted * w / damped * np.sin(damped * t))
        np.testing.assert_allclose(run.q[:, 0], exact, atol=3e-3)

    def test_feet_carry(self):
        """An ankle that carries a person is far stiffer than one that moves a foot."""
        rig = art.load("ragdoll", root="free")
        light, heavy = (art.tuned(rig, 2.0, feet=feet).stiffness for feet in ((), ("left_foot", "right_foot")))
        ankle, elbow = rig.joints["left_ankle"].v_slice, rig.joints["left_elbow"].v_slice
        assert (heavy[ankle] > 100.0 * light[ankle]).all()
        np.testing.assert_array_equal(heavy[elbow], light[elbow])
        # a rod of the body's mass and height on its end, for each leg half
        assert heavy[ankle][0] == pytest.approx((4.0 * np.pi) ** 2 * 0.5 * rig.mass * 1.0**2, rel=0.35)

    def test_errors(self):
        rig = art.load("ragdoll")
        with pytest.raises(ValueError, match=r"frequency is -1\.0; expected a finite number"):
            art.tuned(rig, -1.0)
        with pytest.raises(
            ValueError, match="frequency: rig 'ragdoll' has no moving joint 'left_kne'; did you mean 'left_knee'"
        ):
            art.tuned(rig, {"left_kne": 1.0})
        with pytest.raises(ValueError, match="has no free or planar root to be helped"):
            art.tuned(rig, 1.0, help=2.0)


class TestPushes:
    def test_momentum(self):
        """Each gives force times time, about its point too."""
        rig = art.loose_body(art.Box((0.2, 0.3, 0.4)), mass=2.0)
        pushes = art.Pushes(rig)
        pushes.add("body", (10.0, 0.0, 0.0), start=0.1, duration=0.1, point=(0.0, 0.0, 0.2))
        pushes.add("body", (0.0, 4.0, 0.0), start=0.15, duration=0.2)
        run = art.Simulation(rig, dt=0.001, gravity=(0, 0, 0)).run(duration=0.5, fps=100, external=pushes)
        linear, angular = np.split(art.momentum(rig, run.q, run.v), 2, axis=-1)
        np.testing.assert_allclose(linear[-1], [1.0, 0.8, 0.0], atol=1e-3)
        assert angular[12, 1] == pytest.approx(10.0 * 0.2 * 0.02, rel=0.02)
        np.testing.assert_allclose(linear[:10], 0.0, atol=1e-12)

    def test_errors(self):
        pushes = art.Pushes(art.load("ragdoll"))
        for options, message in (
            ({"link": "nose", "force": (1, 0, 0)}, "nose"),
            ({"link": "head", "force": (1, 0)}, r"force of a push is \[1\.0, 0\.0\]; expected finite numbers"),
            ({"link": "head", "force": (1, 0, np.nan)}, "expected finite numbers"),
            ({"link": "head", "force": (1, 0, 0), "duration": 0.0}, "expected finite times, the second above zero"),
            ({"link": "head", "force": (1, 0, 0), "point": (1, 0)}, "point of a push is"),
        ):
            with pytest.raises(ValueError, match=message):
                pushes.add(**options)


class TestReach:
    def test_poses_that_can_be_reached_are(self, rng):
        rig = art.load("ragdoll", root="free")
        q = rig.random(rng, 20)
        q[:, :7] = rig.neutral()[:7]
        X = art.link_poses(rig, q)
        targets = {name: X[:, rig.links[name].index] for name in ("left_hand", "right_foot")}
        start = art.integrate(rig, q, 0.3 * rng.normal(size=(20, rig.nv)) * (np.arange(rig.nv) >= 6))
        for joint in rig.joints.values():
            if joint.nq <= 2:
                start[:, joint.q_slice] = np.clip(start[:, joint.q_slice], joint.limits.lower, joint.limits.upper)
        found = art.reach(rig, start, targets)
        assert np.quantile(found.distance, 0.8) < 1e-4
        Y = art.link_poses(rig, found.q)
        for name, target in targets.items():
            off = np.linalg.norm(Y[:, rig.links[name].index, :3, 3] - target[:, :3, 3], axis=-1)
            assert (off <= found.distance + 1e-9).all()
        np.testing.assert_array_equal(found.q[:, :7], q[:, :7])

    def test_only_what_may_move_moves(self):
        rig = art.load("ragdoll", root="free")
        found = art.reach(rig, rig.neutral(), {"left_hand": (0.3, 0.4, 0.3)}, joints=["left_shoulder", "left_elbow"])
        assert found.distance < 1e-6
        moved = np.abs(art.difference(rig, rig.neutral(), found.q)) > 1e-9
        parts = [rig.joints[name].v_slice for name in ("left_shoulder", "left_elbow")]
        assert moved.sum() == sum(moved[part].sum() for part in parts)
        assert art.reach(rig, rig.neutral(), {"left_hand": (5.0, 0.0, 0.0)}).distance > 3.0

    def test_errors(self):
        rig = art.load("ragdoll")
        for targets, message in (
            ({}, "targets names no link"),
            ({"left_hand": (1, 2)}, "target of 'left_hand' has shape"),
            ({"nose": (1, 2, 3)}, "nose"),
        ):
            with pytest.raises(ValueError, match=message):
                art.reach(rig, rig.neutral(), targets)
        with pytest.raises(ValueError, match="no moving joint 'left_kne'; did you mean 'left_knee'"):
            art.reach(rig, rig.neutral(), {"left_hand": (0, 0, 0)}, joints=["left_kne"])


@pytest.mark.sweep
def test_standing():
    """A ragdoll with bent knees stands half a minute, and through three pushes of 15 N s; limp, it would have fallen in one second."""
    rig = art.load("ragdoll", root="free")
    feet = ["left_foot", "right_foot"]
    q = rig.neutral()
    for side in ("left", "right"):
        q[rig.joints[f"{side}_hip"].q_slice] = [0.0, np.sin(-0.065), 0.0, np.cos(0.065)]
        q[rig.joints[f"{side}_knee"].q_slice] = 0.25
        q[rig.joints[f"{side}_ankle"].q_slice.start] = -0.12
    q[2] = art.standing_height(rig)
    q[2] += -art.link_poses(rig, q)[rig.links["left_foot"].index, 2, 3] + 0.075
    pushes = art.Pushes(rig)
    for start, force in ((2.0, (150.0, 0.0, 0.0)), (5.0, (0.0, 150.0, 0.0)), (8.0, (-150.0, 0.0, 0.0))):
        pushes.add("torso", force, start=start, duration=0.1)
    simulation = art.Simulation(rig, dt=0.005, ground=True, actuation=art.tuned(rig, 3.0, limit=300.0, feet=feet))
    run = simulation.run(q, duration=30.0, fps=10, control=art.Stander(rig, q, feet), external=pushes)
    assert run.q[:, 2].min() > 0.9
    assert np.abs(run.q[-1, :2]).max() < 0.1
    assert np.abs(run.v[-1]).max() < 0.05
