"""Limits of ball joints: what tilt and twist are, that stops hold where they should, from any side, and that nothing jumps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import articulated as art
from articulated.dynamics.swing_twist import stops_of, tilt_and_twist
from articulated.rig.swing_twist import turn_of

SKEW = art.SwingTwist((0.3, -0.2, -1.0), (1.0, 0.2, 0.0), (0.9, 1.7, 0.5, 2.4), (-0.6, 1.4))
ARM = art.SwingTwist((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (1.2, 0.5, 0.3, 0.9), (-0.4, 0.7))
DEGREE = np.pi / 180.0


def limb(limits: art.SwingTwist, damping: float = 0.05) -> art.Rig:
    builder = art.RigBuilder("limb")
    builder.link("base")
    builder.link("limb", 1.0, (0, 0, -0.25), (0.03, 0.03, 0.01))
    builder.joint("ball", "ball", "base", "limb", limits=art.Limits(ball=limits), damping=damping)
    return builder.build()


def turns(limits: art.SwingTwist, rng, n: int, farthest: float = 3.1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    direction, angle, twist = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, farthest, n), rng.uniform(-2.5, 3.2, n)
    tilt = np.stack([np.cos(direction), np.sin(direction)], axis=-1) * angle[:, None]
    return tilt, twist, turn_of(limits, tilt, twist)


@pytest.fixture(scope="module")
def simulation() -> art.Simulation:
    return art.Simulation(limb(ARM), dt=0.002, gravity=(0, 0, 0), actuation=art.PD(60.0, 2.0))


class TestTiltAndTwist:
    def test_a_swing_after_a_twist(self, rng):
        tilt, twist, quat = turns(SKEW, rng, 500)
        u, w, a = SKEW.frame.T
        swing = Rotation.from_rotvec(np.cross(a, tilt[:, :1] * u + tilt[:, 1:] * w))
        both = (swing * Rotation.from_rotvec(twist[:, None] * a)).as_quat()
        np.testing.assert_allclose(np.abs(np.sum(both * quat, axis=-1)), 1.0, atol=1e-14)

    def test_taken_apart_again(self, rng):
        tilt, twist, quat = turns(SKEW, rng, 500)
        for sign in (1.0, -1.0):
            t_u, t_w, t = tilt_and_twist(SKEW, list(sign * quat.T))
            np.testing.assert_allclose(np.stack([t_u, t_w], axis=-1), tilt, atol=1e-12)
            np.testing.assert_allclose((t - twist + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=1e-12)

    def test_directions_are_gradients(self, rng):
        tilt, _, quat = turns(SKEW, rng, 500, 2.6)
        half = np.where(tilt > 0.0, np.array(SKEW.swing)[[0, 2]], np.array(SKEW.swing)[[1, 3]])
        F = ((tilt / half) ** 2).sum(axis=-1)
        (n, ((_, left),)), (d, ((_, above), _)) = stops_of(SKEW, list(quat.T))
        scale = left / (0.5 * (1.0 - F))
        far = np.linalg.norm(tilt, axis=-1) > 0.2  # near the middle it is cut short
        np.testing.assert_allclose(np.sum(np.square(list(n)), axis=0)[far], 1.0, atol=1e-12)
        for k in range(3):
            step = np.zeros(3)
            step[k] = 1e-6
            there, back = ((Rotation.from_quat(quat) * Rotation.from_rotvec(s * step)).as_quat() for s in (1.0, -1.0))
            ends = [tilt_and_twist(SKEW, list(q.T)) for q in (there, back)]
            t = [np.stack(end[:2], axis=-1) / half for end in ends]
            np.testing.assert_allclose(list(n)[k], scale * np.sum(t[0] ** 2 - t[1] ** 2, axis=-1) / 4e-6, atol=1e-7)
            np.testing.assert_allclose(list(d)[k], (ends[0][2] - ends[1][2]) / 2e-6, atol=1e-7)
        assert above.shape == (500,)

    def test_circles_have_their_own_distance(self, rng):
        """Of a round cone the room left is that of the angle, to first order."""
        round_ = art.SwingTwist(swing=(1.0,) * 4)
        for angle in (0.98, 1.0, 1.02):
            quat = Rotation.from_rotvec([0.6 * angle, 0.8 * angle, 0.0]).as_quat()
            ((_, ((_, left),)),) = stops_of(round_, quat.tolist())
            assert left == pytest.approx(1.0 - angle, abs=3e-4)

    @pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, np.pi - 1e-6, np.pi])
    def test_nothing_is_undefined(self, angle):
        for axis in np.eye(3):
            for direction, ends in stops_of(ARM, Rotation.from_rotvec(angle * axis).as_quat().tolist()):
                assert np.isfinite([*direction, *(left for _, left in ends)]).all()
                assert np.linalg.norm(list(direction)) < 7.0

    def test_random_configurations_are_within(self, rng):
        rig = limb(SKEW)
        q = rig.random(rng, 2000)
        t_u, t_w, twist = tilt_and_twist(SKEW, list(q.T))
        reach = np.where(t_u > 0, SKEW.swing[0], SKEW.swing[1]), np.where(t_w > 0, SKEW.swing[2], SKEW.swing[3])
        F = (t_u / reach[0]) ** 2 + (t_w / reach[1]) ** 2
        assert 0.9 < F.max() <= 1.0 + 1e-12
        assert -0.6 <= twist.min() < -0.5
        assert 1.3 < twist.max() <= 1.4 + 1e-12


class TestStops:
    def test_a_swing_stops_at_the_cone_wherever_it_goes(self, simulation):
        """Driven against it by some 20 N m; within a degree, measured along the way out."""
        direction = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        tilt = 1.6 * np.stack([np.cos(direction), np.sin(direction)], axis=-1)
        run = simulation.run(np.tile([0, 0, 0, 1.0], (24, 1)), duration=3.0, control=turn_of(ARM, tilt, np.zeros(24)))
        t = np.stack(tilt_and_twist(ARM, list(np.moveaxis(run.q, -1, 0)))[:2], axis=-1)
        half = np.where(t > 0.0, np.array(ARM.swing)[[0, 2]], np.array(ARM.swing)[[1, 3]])
        reached, F = np.linalg.norm(t, axis=-1), ((t / half) ** 2).sum(axis=-1)
        beyond = reached[:, -1] * (1.0 - 1.0 / np.sqrt(F[:, -1]))
        assert np.abs(beyond).max() < DEGREE
        assert np.max(reached[:, 1:] * (1.0 - 1.0 / np.sqrt(F[:, 1:]))) < 2.0 * DEGREE  # and so while it arrives
        assert run.report["limit violation"].value < 2.0 * DEGREE

    def test_a_twist_stops_at_its_range(self, simulation):
        for wanted, end in ((2.0, 0.7), (-2.0, -0.4)):
            q = turn_of(ARM, np.array([[0.0, 0.0], [0.6, 0.0], [0.0, 0.4]]), np.full(3, wanted))
            run = simulation.run(np.tile([0, 0, 0, 1.0], (3, 1)), duration=3.0, control=q)
            *_, twist = tilt_and_twist(ARM, list(run.q[:, -1].T))
            np.testing.assert_allclose(twist, end, atol=DEGREE)

    def test_hits_at_speed(self):
        """However it comes, it comes back slower, and never far beyond."""
        rig = limb(ARM, 0.0)
        rng = np.random.default_rng(1)
        v = rng.normal(size=(32, 3)) * 15.0
        run = art.Simulation(rig, dt=0.005, gravity=(0, 0, 0)).run(np.tile([0, 0, 0, 1.0], (32, 1)), v, duration=3.0, fps=200)
        assert (np.diff(run.kinetic_energy, axis=-1) < 2e-3 * run.kinetic_energy[:, :1]).all()
        assert run.report["limit violation"].value < 0.3  # some come at 40 rad/s, a fifth of a radian a step
        assert (run.kinetic_energy[:, -1] < 0.5 * run.kinetic_energy[:, 0]).all()
        late = run.q[:, -1]
        for _, ends in stops_of(ARM, list(late.T)):
            for _, left in ends:
                assert np.min(left) > -DEGREE


class TestHalfATurn:
    def test_a_range_about_half_a_turn(self):
        """A twist from 100 to 260 degrees passes 180 as if nothing were there, and stops at the end."""
        limits = art.SwingTwist(twist=(100 * DEGREE, 260 * DEGREE))
        rig = limb(limits, 0.0)
        start = Rotation.from_rotvec([0, 0, 110 * DEGREE]).as_quat()
        run = art.Simulation(rig, dt=0.002, gravity=(0, 0, 0)).run(start, [0, 0, 2.0], duration=2.0, fps=100)
        *_, twist = tilt_and_twist(limits, list(run.q.T))
        before = twist < 250 * DEGREE
        np.testing.assert_allclose(run.v[before, 2], 2.0, atol=1e-9)
        assert before.sum() > 100
        assert twist.max() < 261 * DEGREE
        assert run.v[-1, 2] <= 1e-9

    @pytest.mark.parametrize("twist", [0.0, 0.3, 0.79])
    def test_a_free_swing_goes_right_round(self, twist):
        """Straight through where the axis points back, with a twist within, and at the end, of its range."""
        limits = art.SwingTwist(axis=(0, 0, 1), twist=(-0.8, 0.8))
        rig = limb(limits, 0.0)
        turn = Rotation.from_rotvec([0, 0, twist])
        start = turn.as_quat(), turn.inv().apply([4.0, 0, 0])
        stopped, free = (
            art.Simulation(rig, dt=0.002, gravity=(0, 0, 0), limits=limits, integrator="semi_implicit").run(
                *start, duration=2.0
            )
            for limits in (True, False)
        )
        np.testing.assert_allclose(stopped.v, free.v, atol=1e-6)

    def test_beside_that_point(self):
        """Past it at a small distance, where a twist grows by nearly half a turn: no blow, no gain."""
        limits = art.SwingTwist(axis=(0, 0, 1), twist=(-0.8, 0.8))
        rig = limb(limits, 0.0)
        q = Rotation.from_rotvec(np.stack([np.linspace(0.01, 0.3, 16), 0 * np.ones(16), 0 * np.ones(16)], axis=-1)).as_quat()
        v = np.tile([0.0, 5.0, 0.0], (16, 1))
        run = art.Simulation(rig, dt=0.002, gravity=(0, 0, 0)).run(q, v, duration=3.0, fps=100)
        assert (np.diff(run.kinetic_energy, axis=-1) < 2e-2 * run.kinetic_energy[:, :1]).all()
        assert (run.kinetic_energy[:, -1] < 1.02 * run.kinetic_energy[:, 0]).all()


class TestDescriptions:
    def test_urdf_says_it(self):
        rig = limb(SKEW)
        again = art.load(rig.to_urdf())
        assert again.joints["ball"].limits == rig.joints["ball"].limits
        assert again.to_urdf() == rig.to_urdf()

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({"axis": (0, 0, 0)}, r"axis \(0\.0, 0\.0, 0\.0\) and toward .* parallel or zero; give the bone's direction"),
            ({"axis": (1, 0, 0)}, "parallel or zero"),
            ({"axis": "up"}, "axis of a ball joint's limits is 'up'; expected 3 finite numbers"),
            ({"swing": (1, 1, 1)}, "swing of a ball joint's limits is .*; expected 4 finite numbers"),
            ({"swing": (1, -1, 1, 1)}, "expected four angles, zero or more"),
            ({"twist": (1, -1)}, "expected least and largest angle, a turn apart at most"),
            ({"twist": (-4, 4)}, "a turn apart at most"),
            ({"twist": (0, np.nan)}, "expected 2 finite numbers"),
        ],
    )
    def test_impossible_ones(self, given, message):
        with pytest.raises(ValueError, match=message):
            art.SwingTwist(**given)

    def test_other_joints_have_none(self):
        builder = art.RigBuilder()
        with pytest.raises(art.RigError, match="a revolute joint has no swing and twist; give lower and upper limits"):
            builder.joint("knee", "revolute", "a", "b", limits=art.Limits(ball=ARM))
        with pytest.raises(art.RigError, match="has both an upper limit and a swing and twist; leave one of them out"):
            builder.joint("hip", "ball", "a", "b", limits=art.Limits(upper=1.0, ball=ARM))
        with pytest.raises(art.RigError, match=r"limits of a ball joint are 3; give an articulated\.SwingTwist"):
            builder.joint("hip", "ball", "a", "b", limits=art.Limits(ball=3))

    def test_a_file_with_a_fault(self):
        text = limb(ARM).to_urdf().replace('swing="1.2 0.5 0.3 0.9"', 'swing="1.2 -0.5 0.3 0.9"')
        with pytest.raises(art.RigError, match=r":\d+: joint 'ball'.*swing .*expected four angles, zero or more"):
            art.load(text)
