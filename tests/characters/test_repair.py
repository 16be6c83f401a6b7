"""Flips that are undone, and what is left."""

from __future__ import annotations

import numpy as np
import pytest

import articulated as art


@pytest.fixture(scope="module")
def sway(double_pendulum) -> art.Motion:
    rig, t = double_pendulum, np.arange(60)[:, None] / 30.0
    dv = 0.5 * np.sin(t * np.linspace(1.0, 3.0, rig.nv))
    return art.Motion(rig, art.integrate(rig, rig.neutral(), dv), 30.0, "sway")


def flipped(motion: art.Motion, frames, joint: str = "elbow") -> art.Motion:
    """A joint turned by half a turn about x in some frames."""
    q, dv = motion.q.copy(), np.zeros(motion.rig.nv)
    dv[motion.rig.joints[joint].v_slice] = (3.0, 0.0, 0.0)
    q[frames] = art.integrate(motion.rig, q[frames], dv)
    return art.Motion(motion.rig, q, motion.fps, motion.name)


def distance(a: art.Motion, b: art.Motion) -> np.ndarray:
    return np.abs(art.difference(a.rig, a.q, b.q)).max(axis=-1)


@pytest.mark.parametrize(
    ("frames", "said"), [([20], "frame 20"), ([20, 21, 22], "frames 20-22"), ([10, 30, 31], "frames 10, 30-31")]
)
def test_flips_are_undone(sway, frames, said):
    with pytest.warns(art.RigWarning, match=rf"motion 'sway': joint 'elbow': was flipped in {said}; goes there from"):
        again = art.repaired(flipped(sway, frames))
    away = distance(sway, again)
    assert np.delete(away, frames).max() < 1e-12
    assert away[frames].max() < 0.02  # a straight way, where it was curved
    shoulder = sway.rig.joints["shoulder"].q_slice
    np.testing.assert_allclose(again.q[:, shoulder], sway.q[:, shoulder], atol=1e-15)


def test_a_frame_at_the_beginning(sway):
    with pytest.warns(art.RigWarning, match="was flipped in frame 0"):
        again = art.repaired(flipped(sway, [0]))
    elbow = sway.rig.joints["elbow"].q_slice
    np.testing.assert_allclose(again.q[0, elbow], sway.q[1, elbow], atol=1e-12)


def test_what_stays_flipped_is_told(sway):
    given = flipped(sway, np.arange(25, 60))
    with pytest.warns(art.RigWarning, match=r"jumps after frame 24, and not back within 0\.1 s; left"):
        again = art.repaired(given)
    np.testing.assert_array_equal(again.q, given.q)


def test_nothing_to_do(sway, recwarn):
    again = art.repaired(sway)
    np.testing.assert_array_equal(again.q, sway.q)
    assert not recwarn.list


def test_arguments(sway):
    with pytest.raises(ValueError, match="fast is 0; expected a positive number of radians or metres a second"):
        art.repaired(sway, fast=0)
    with pytest.raises(ValueError, match="longest is -1"):
        art.repaired(sway, longest=-1)
