"""Motions: between frames and at them, at other rates, filtered, in files; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import articulated as art


@pytest.fixture(scope="module")
def rig() -> art.Rig:
    builder = art.RigBuilder("arm")
    builder.link("base", 1.0, inertia=(0.1, 0.1, 0.1))
    builder.link("upper", 1.0, (0, 0, -0.2), (0.02, 0.02, 0.01))
    builder.link("lower", 1.0, (0, 0, -0.2), (0.02, 0.02, 0.01))
    builder.joint("shoulder", "ball", "base", "upper")
    builder.joint("elbow", "revolute", "upper", "lower", xyz=(0, 0, -0.4), axis=(0, 1, 0))
    return builder.build("free")


def wave(rig: art.Rig, fps: float, duration: float = 2.0) -> art.Motion:
    """Everything moves, smoothly, and the shoulder goes round more than once."""
    t = np.arange(round(duration * fps) + 1) / fps
    q = np.tile(rig.neutral(), (len(t), 1))
    q[:, :3] = np.stack([np.sin(t), t, np.cos(2 * t)], axis=-1)
    q[:, 3:7] = Rotation.from_euler("zyx", np.stack([t, 0.5 * np.sin(t), 0.3 * np.cos(t)], axis=-1)).as_quat()
    q[:, 7:11] = Rotation.from_rotvec(np.outer(4.0 * t, [0.6, 0.0, 0.8])).as_quat()
    q[:, 11] = np.sin(3.0 * t)
    return art.Motion(rig, q, fps)


def apart(rig: art.Rig, a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(art.difference(rig, a, b)).max())


class TestBetweenFrames:
    def test_frames_are_met(self, rig):
        motion = wave(rig, 30.0)
        assert apart(rig, motion.at(motion.time), motion.q) < 1e-12
        np.testing.assert_allclose(motion.velocity(motion.time[:-1]), motion.v[:-1], atol=1e-9)

    def test_of_third_order(self, rig):
        """Halving the steps between frames makes errors an eighth, at least."""
        t = np.linspace(0.2, 1.8, 57)
        exact = wave(rig, 1000.0).at(t)
        errors = [apart(rig, wave(rig, fps).at(t), exact) for fps in (15.0, 30.0, 60.0)]
        assert errors[0] / errors[1] > 6.0
        assert errors[1] / errors[2] > 6.0
        assert errors[2] < 1e-4

    def test_velocities_are_derivatives(self, rig):
        motion, h = wave(rig, 30.0), 1e-6
        for t in (0.31, 0.5001, 1.777):
            moved = art.difference(rig, motion.at(t - h), motion.at(t + h)) / (2 * h)
            np.testing.assert_allclose(motion.velocity(t), moved, atol=2e-2)

    def test_beyond_the_ends(self, rig):
        motion = wave(rig, 30.0)
        np.testing.assert_allclose(motion.at([-1.0, 99.0]), motion.q[[0, -1]], atol=1e-12)
        np.testing.assert_array_equal(motion.velocity([-1.0, 99.0]), 0.0)
        assert apart(rig, motion.at(motion.duration + 0.4, loop=True), motion.at(0.4)) < 1e-9

    def test_signs_of_quaternions_mean_nothing(self, rig):
        motion = wave(rig, 30.0)
        q = motion.q.copy()
        q[::3, 7:11] *= -1.0
        q[5:9, 3:7] *= -1.0
        again = art.Motion(rig, q, 30.0)
        np.testing.assert_allclose(again.v, motion.v, atol=1e-12)
        assert (np.sum(again.q[1:, 7:11] * again.q[:-1, 7:11], axis=-1) > 0.0).all()


class TestOtherRates:
    def test_the_same_rate_is_the_same(self, rig):
        motion = wave(rig, 120.0)
        assert apart(rig, motion.resampled(120.0).q, motion.q) < 1e-12

    def test_there_and_back(self, rig):
        motion = wave(rig, 120.0)
        back = motion.resampled(30.0).resampled(120.0)
        assert back.fps == 120.0
        assert apart(rig, back.q[8:-8], motion.q[8 : len(back.q) - 8]) < 2e-3

    def test_parts(self, rig):
        part = wave(rig, 30.0).part(0.5, 1.0)
        assert len(part.q) == 16
        assert part.duration == pytest.approx(0.5)

    def test_of_a_run(self, rig):
        run = art.simulate(rig, duration=0.5, v0=np.ones(rig.nv))
        np.testing.assert_array_equal(run.motion().q[-1], run.q[-1])
        assert run.motion(30.0).fps == 30.0
        batch = art.simulate(rig, duration=0.1, q0=np.tile(rig.neutral(), (2, 1)))
        with pytest.raises(ValueError, match=r"a batch \(2,\) is no one motion; take one of its states"):
            batch.motion()


class TestFilter:
    def test_what_is_slow_stays_and_what_is_fast_goes(self, rig):
        motion = wave(rig, 120.0)
        still = motion.filtered(12.0)
        assert apart(rig, still.q[20:-20], motion.q[20:-20]) < 3e-3
        noise = np.random.default_rng(0).normal(size=motion.v.shape) * 0.02
        rough = art.Motion(rig, art.integrate(rig, motion.q, noise), 120.0)
        mended = rough.filtered(6.0)
        before, after = (art.difference(rig, m.q, motion.q)[20:-20].std() for m in (rough, mended))
        assert after < 0.45 * before
        assert np.abs(np.linalg.norm(mended.q[:, 7:11], axis=-1) - 1.0).max() < 1e-12

    @pytest.mark.parametrize("cutoff", [0.0, 60.0, -1.0, np.nan])
    def test_impossible_ones(self, rig, cutoff):
        with pytest.raises(ValueError, match=r"cutoff is .* Hz; expected more than 0, and less than half of 120 fps"):
            wave(rig, 120.0).filtered(cutoff)


class TestFiles:
    def test_csv_and_npz(self, rig, tmp_path):
        motion = wave(rig, 30.0)
        motion.export(tmp_path / "wave.csv", fps=15.0)
        rows = np.loadtxt(tmp_path / "wave.csv", delimiter=",", skiprows=1)
        np.testing.assert_allclose(rows[:, 1:], motion.resampled(15.0).q, atol=1e-15)
        motion.export(tmp_path / "wave.npz")
        with np.load(tmp_path / "wave.npz") as data:
            np.testing.assert_array_equal(data["q"], motion.q)
            assert art.load(str(data["rig"]), root="free").nq == rig.nq
        with pytest.raises(ValueError, match=r"unknown format '\.fbx'; known are \.bvh, \.csv, \.glb, \.npz"):
            motion.export(tmp_path / "wave.fbx")


class TestErrors:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda q: q[:, :-1], r"q has shape \(61, 11\); expected \(\.\.\., 12\)"),
            (lambda q: q[:1], r"q has shape \(1, 12\); expected \(T, 12\), two frames at least"),
            (lambda q: q[0], r"q has shape \(12,\); expected \(T, 12\), two frames at least"),
            (lambda q: q * np.where(np.arange(12) == 5, np.nan, 1.0), r"q\[0, 5\] is nan"),
            (lambda q: q * 1.1, "quaternion of joint .* has norm 1\\.1"),
        ],
    )
    def test_configurations(self, rig, change, message):
        with pytest.raises(ValueError, match=message):
            art.Motion(rig, change(wave(rig, 30.0).q), 30.0)

    @pytest.mark.parametrize("fps", [0.0, -1.0, np.nan, np.inf, "fast"])
    def test_rates(self, rig, fps):
        with pytest.raises(ValueError, match=r"fps is .*; expected a positive number of frames a second"):
            art.Motion(rig, wave(rig, 30.0).q, fps)
        with pytest.raises(ValueError, match=r"fps is .*; expected a positive number of frames a second"):
            wave(rig, 30.0).resampled(fps)

    def test_times(self, rig):
        with pytest.raises(ValueError, match="time holds NaN; expected seconds"):
            wave(rig, 30.0).at([0.0, np.nan])
        with pytest.raises(ValueError, match=r"from 5 s to 6 s there are 0 frames; it lasts 2 s"):
            wave(rig, 30.0).part(5.0, 6.0)
