"""Recorded particles: frames, files, and what is wrong with them."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import articulated as art
from articulated import particles as ap


def cloth():
    made = ap.grid_cloth((0, 0, 1), (1, 0, 0), (0, 1, 0), 5, 4, 0.2, 100.0, bending=1e-4)
    return ap.System(made.x, None, made.mass, [ap.Gravity(), *made.forces], pinned=[0, 3])


@pytest.fixture(scope="module")
def run():
    return cloth().run(0.5, 1e-3, fps=20.0)


def test_frames(run):
    assert run.time == pytest.approx(np.arange(11) / 20.0)
    assert run.x.shape == run.v.shape == (11, 20, 3)
    assert run.fps == pytest.approx(20.0)
    system = cloth()
    for frame in range(11):
        np.testing.assert_array_equal(run.x[frame], system.x)
        np.testing.assert_array_equal(run.v[frame], system.v)
        assert run.energy[frame] == system.energy()
        system.step(1e-3, steps=50)


def test_steps_fall_on_frames():
    system = cloth()
    run = system.run(0.1, 0.011, "implicit_euler", fps=30.0)
    assert len(run.time) == 4
    assert system.time == pytest.approx(0.1)
    other = cloth()
    for _ in range(3 * 4):
        other.step(1 / 120, "implicit_euler")
    np.testing.assert_array_equal(run.x[-1], other.x)


def test_what_is_drawn(run):
    assert len(run.segments) == 4 * 4 + 5 * 3 + 2 * 4 * 3
    assert len(run.triangles) == 2 * 4 * 3
    area = np.linalg.norm(np.cross(*(run.x[0][run.triangles[:, k]] - run.x[0][run.triangles[:, 0]] for k in (1, 2))), axis=1)
    assert 0.5 * area.sum() == pytest.approx(1.0)


def test_files(run, tmp_path):
    run.save(tmp_path / "cloth.npz")
    again = art.Cloud.load(tmp_path / "cloth.npz")
    for name, array in run.arrays().items():
        np.testing.assert_array_equal(array, getattr(again, name))
    run.export(tmp_path / "cloth.csv")
    with open(tmp_path / "cloth.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 11 * 20
    assert float(rows[-1]["vz"]) == run.v[-1, -1, 2]
    with pytest.raises(ValueError, match=r"unknown format '\.obj'"):
        run.export(tmp_path / "cloth.obj")
    with pytest.raises(ValueError, match=r"does not end in \.npz"):
        run.save(tmp_path / "cloth.txt")


def test_damaged_files(run, tmp_path):
    path = tmp_path / "cloth.npz"
    run.save(path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match="is damaged"):
        art.Cloud.load(path)
    with pytest.raises(FileNotFoundError):
        art.Cloud.load(tmp_path / "none.npz")
    art.simulate(art.load("pendulum"), 0.1).save(path)
    with pytest.raises(ValueError, match="holds something else"):
        art.Cloud.load(path)
    arrays = {**run.arrays(), "v": run.v[:5]}
    np.savez(path, about='{"format": 1, "kind": "cloud"}', **arrays)
    with pytest.raises(ValueError, match="v has shape"):
        art.Cloud.load(path)


def test_what_rigs_carry_is_in_their_trajectories(tmp_path):
    rig = art.loose_body(art.Sphere(0.1), 1.0)
    hair = ap.hair_on("body", [(-0.1, 0.0, 0.1)], (-1.0, 0.0, 0.0), 0.3, 6, 0.05, 1e3)
    run = art.Simulation(rig, dt=0.01, particles=hair).run(v0=np.zeros((2, rig.nv)), duration=0.1, fps=20.0)
    run.save(tmp_path / "run.npz")
    again = art.Trajectory.load(tmp_path / "run.npz")
    for name, array in run.particles.arrays().items():
        np.testing.assert_array_equal(array, getattr(again.particles, name))
    assert repr(again.particles) == "Cloud(6 particles, 3 frames, 0.1 s, states (2,))"
    np.testing.assert_array_equal(again.state(1).particles.x, run.particles.x[1])
    with pytest.raises(ValueError, match="the batch has 1 axes"):
        run.particles.state(0, 0)


def test_errors_of_runs():
    for arguments, match in (
        ((0.0, 1e-3), "duration is 0"),
        ((1.0, np.nan), "dt"),
        ((0.01, 1e-3), "shorter than one frame"),
        ((1.0, 1e-3, "leapfrog"), "expected one of"),
    ):
        with pytest.raises(ValueError, match=match):
            cloth().run(*arguments)
