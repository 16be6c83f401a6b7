"""A .glb is what Khronos's validator accepts, and plays in a browser: three.js moves its nodes as the rig moves.

Needs Node.js, Chromium and, once, `npm install` in tests/browser; without these it is skipped. See tests/browser/play.mjs.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import articulated as art

FOLDER = Path(__file__).parents[1] / "browser"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
CHROMIUM = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)

pytestmark = [
    pytest.mark.sweep,
    pytest.mark.timeout(300),
    pytest.mark.skipif(shutil.which("node") is None, reason="Node.js is not installed"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: install it, or name it in the environment as CHROMIUM"),
    pytest.mark.skipif(not (FOLDER / "node_modules").exists(), reason="run `npm install` in tests/browser once"),
]

Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def falling_ragdoll(robots: Path) -> art.Trajectory:
    rig = art.load("ragdoll", root="free")
    q, v = rig.neutral(), np.zeros(rig.nv)
    q[2], v[3] = 1.3, 1.0
    return art.Simulation(rig, ground=True).run(q, v, duration=1.5)


def turning_four_bar(robots: Path) -> art.Trajectory:
    return art.Simulation(art.load("four_bar"), dt=0.001).run(v0=[6.0, 0.0, 0.0], duration=0.6)


def swinging_arm(robots: Path) -> art.Trajectory:
    rig = art.load(robots / "ur_description/urdf/ur5_robot.urdf")
    return art.Simulation(rig).run([0.3, -1.0, 0.8, 0.2, 0.5, 0.1], duration=1.0)


@pytest.mark.parametrize("make", [falling_ragdoll, turning_four_bar, swinging_arm])
def test_plays(make, robots, tmp_path):
    run = make(robots)
    frames = [0, len(run.time) // 2, len(run.time) - 1]
    run.export(tmp_path / "motion.glb")
    command = ["node", str(FOLDER / "play.mjs"), str(tmp_path / "motion.glb"), str(tmp_path)]
    done = subprocess.run(
        [*command, *(repr(float(run.time[k])) for k in frames)],
        capture_output=True,
        text=True,
        env={**os.environ, "CHROMIUM": str(CHROMIUM)},
    )
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)

    assert (seen["issues"]["numErrors"], seen["issues"]["numWarnings"]) == (0, 0), seen["issues"]["messages"]
    assert seen["complaints"] == []
    (clip,) = seen["clips"]
    assert clip["duration"] == pytest.approx(run.time[-1], abs=1e-6)

    X = art.link_poses(run.rig, run.q[frames])
    for k, shown in enumerate(seen["frames"]):
        for name, link in run.rig.links.items():
            node = np.reshape(shown["nodes"][name], (4, 4)).T
            np.testing.assert_allclose(node[:3, :3], Y_UP @ X[k, link.index, :3, :3], atol=2e-6)
            np.testing.assert_allclose(node[:3, 3], Y_UP @ X[k, link.index, :3, 3], atol=2e-6)

    pictures = [np.asarray(Image.open(tmp_path / f"motion_{k}.png").convert("RGB"), dtype=float) for k in range(3)]
    for one, other in [(0, 1), (1, 2), (0, 2)]:
        changed = np.abs(pictures[one] - pictures[other]).max(axis=-1) > 30.0
        assert 0.001 < changed.mean() < 0.5
