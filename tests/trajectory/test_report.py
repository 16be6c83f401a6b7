"""The certificate of a run says what is so."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import articulated as art


@pytest.fixture(scope="module")
def run() -> art.Trajectory:
    rig = art.load("ragdoll", "free")
    return art.Simulation(rig, dt=0.005, integrator="rk4").run(rig.random(0, 2), duration=0.2, fps=20)


def test_a_good_run(run):
    assert run.report.passed
    assert bool(run.report)
    assert str(run.report).startswith("passed\n  2 states completed\n  energy drift")
    assert run.report["energy drift"].value < 1e-2
    with pytest.raises(KeyError, match="no check 'weight'; there are 'energy drift', 'quaternion norm', 'limit violation'"):
        run.report["weight"]


def test_lost_energy_is_noticed(run):
    kinetic = run.kinetic_energy.copy()
    kinetic[1, 2] *= 0.9
    report = dataclasses.replace(run, kinetic_energy=kinetic).report
    assert not report
    assert not report["energy drift"].passed
    assert "NOT PASSED" in str(report)
    assert "<- take a smaller dt, or integrator='rk4' or 'dopri5'" in str(report)


def test_work_is_taken_into_account(run):
    work = run.work + np.linspace(0.0, 1.0, len(run.time)) * run.kinetic_energy.max()
    assert dataclasses.replace(run, work=work).report["energy drift"].value == pytest.approx(1.0, rel=0.1)


def test_a_long_quaternion_is_noticed(run):
    q = run.q.copy()
    q[0, 1, run.rig.joints["neck"].q_slice] *= 1 + 1e-6
    check = dataclasses.replace(run, q=q).report["quaternion norm"]
    assert check.value == pytest.approx(1e-6, rel=1e-3)
    assert not check.passed


def test_limits(run):
    q = np.broadcast_to(run.rig.neutral(), run.q.shape).copy()
    still = dataclasses.replace(run, q=q)
    assert still.report["limit violation"].value == 0.0
    q[1, 3, run.rig.joints["left_knee"].q_slice] = -0.3
    assert dataclasses.replace(run, q=q).report["limit violation"].value == pytest.approx(0.3)
    q[0, 0, run.rig.joints["neck"].q_slice] = [np.sin(0.65), 0.0, 0.0, np.cos(0.65)]  # 1.3 rad, allowed 0.8
    check = dataclasses.replace(run, q=q).report["limit violation"]
    assert check.value == pytest.approx(0.5)
    assert check.passed, "nothing enforces limits yet"


def test_every_outcome_but_the_good_one_has_a_remedy():
    assert [bool(outcome.remedy) for outcome in art.Outcome] == [False, True, True, True]
