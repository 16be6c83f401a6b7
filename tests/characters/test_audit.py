"""What an audit measures, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import articulated as art

G = 9.81


@pytest.fixture(scope="module")
def arm() -> art.Rig:
    """A ball in the air, 2 kg, that carries 1 kg at the end of 0.5 m, on a hinge."""
    builder = art.RigBuilder("arm")
    builder.link("trunk", 2.0, inertia=(0.01, 0.01, 0.01), collisions=[art.Sphere(0.1)])
    builder.link("bob", 1.0, (0.5, 0.0, 0.0), (1e-3, 1e-3, 1e-3))
    builder.joint("hinge", "revolute", "trunk", "bob", axis=(0, 1, 0), limits=art.Limits(-0.5, 1.0))
    return builder.build("free")


def motion(rig: art.Rig, frames: int = 61, **columns) -> art.Motion:
    q = np.tile(rig.neutral(), (frames, 1))
    for name, values in columns.items():
        q[:, rig.q_names.index(name.replace("root_", "root_joint."))] = values
    return art.Motion(rig, q, 60.0)


def test_at_rest(arm):
    found = art.audit(motion(arm, root_z=1.0))
    assert found.torques["hinge"] == pytest.approx(0.5 * G)
    assert found.root_force == pytest.approx((3.0 * G, 3.0 * G))
    assert found.root_couple == pytest.approx((0.5 * G, 0.5 * G))
    assert (found.sliding, found.penetration, found.violations, found.jumps) == ({}, 0.0, {}, ())


def test_free_fall_needs_no_root_force(arm):
    t = np.arange(61) / 60.0
    found = art.audit(motion(arm, root_z=10.0 - 0.5 * G * t * t, hinge=0.0))
    assert found.root_force[1] < 1e-6 * 3.0 * G
    assert found.torques["hinge"] < 1e-6


def test_sliding_and_penetration(arm):
    t = np.arange(61) / 60.0
    found = art.audit(motion(arm, root_x=0.3 * t, root_z=0.08))
    assert found.sliding == pytest.approx({"trunk": 0.3})
    assert found.penetration == pytest.approx(0.02)


def test_violations_and_jumps(arm):
    hinge = np.where(np.arange(61) < 30, -0.7, 1.2)
    found = art.audit(motion(arm, root_z=1.0, hinge=hinge))
    assert found.violations == pytest.approx({"hinge": 0.2})
    (jump,) = found.jumps
    assert (jump.joint, jump.time) == ("hinge", pytest.approx(29 / 60))
    assert jump.speed == pytest.approx(1.9 * 60.0)
    assert "jump               hinge at 0.483 s, 114 rad/s" in str(found)
    assert "beyond limits      hinge 0.2 rad or m" in str(found)
