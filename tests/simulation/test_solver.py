"""The implicit step's solution against a dense solver of the same problem, and what it reports of itself."""

from __future__ import annotations

import numpy as np
import pytest
from contact_rigs import points_of, rig_of
from dense_step import Dense, near_ground, under_way

import articulated as art

MATERIAL = art.Material(friction=0.8, stiffness=5e4, dissipation=10.0)


@pytest.mark.parametrize("name", ["g1", "solo12", "human", "ragdoll", "chain"])
@pytest.mark.parametrize("limited", [False, True])
def test_solution_is_that_of_a_dense_solver(name, limited):
    """50 states each: contact, stops and drives (with limited torque, and dry friction in joints, or without)."""
    rig, rng, h = rig_of(name), np.random.default_rng(5), 0.002
    rig = rig.with_joints(damping=0.05, friction=0.1) if limited else rig.with_joints(damping=0.05)
    points = points_of(rig)
    free = np.arange(rig.nv) >= 6
    stops = art.Stops()
    pd = art.PD(stiffness=30.0, damping=1.0, limit=2.0 if limited else np.inf)
    ground = art.Ground(friction=0.8, stiffness=5e4, dissipation=10.0)
    simulation = art.Simulation(rig, dt=h, ground=ground, contact_points=points, limits=stops, actuation=pd, tolerance=1e-12)
    q, v = near_ground(rig, points, 50, rng)
    q[:, 2] -= np.linspace(0.0, 0.02, len(q))
    target = rig.neutral()
    state = simulation.step(under_way(simulation, simulation.reset(q, v)), target)
    limit = np.where(free, 2.0, 1e9) if limited else None
    dense = Dense(rig, points, MATERIAL, h, 30.0 * free, 1.0 * free, target, limit, stops, before=h)
    touched = 0
    for k in range(len(q)):
        expected = dense.solve(q[k], v[k])
        got = state.v[k].copy()
        R_new, R_old = (art.link_poses(rig, x)[0, :3, :3] for x in (state.q[k], q[k]))
        got[:3] = R_old.T @ R_new @ got[:3]  # both in the root's axes at the start of the step
        assert np.abs(got - expected).max() < 1e-9 * np.abs(expected).max(), k
        touched += bool((dense.push(dense.hinges, (dense.J @ expected)[:, 2])[0] > 0.0).any())
    assert touched >= 25


def test_residual_is_the_residual():
    """What a step reports is what its velocities and contact forces leave, by the formula."""
    rig, rng, h = rig_of("g1"), np.random.default_rng(6), 0.002
    points = points_of(rig)
    ground = art.Ground(friction=0.8, stiffness=5e4, dissipation=10.0)
    simulation = art.Simulation(rig, dt=h, ground=ground, contact_points=points, limits=False, tolerance=0.05)
    q, v = near_ground(rig, points, 20, rng)
    state = simulation.step(simulation.reset(q, v))
    reported, sweeps = simulation.residual(state), state.motion()[:, simulation._world.layout.stance.latest]
    assert (reported < 0.05).all()
    assert (reported > 1e-9).sum() > 5
    zero = np.zeros(rig.nv)
    dense = Dense(rig, points, MATERIAL, h, zero, zero, rig.neutral(), None, None)
    for k in range(len(q)):
        dense.solve(q[k], v[k], int(sweeps[k]))  # for the friction cones
        end = state.v[k].copy()
        R_new, R_old = (art.link_poses(rig, x)[0, :3, :3] for x in (state.q[k], q[k]))
        end[:3] = R_old.T @ R_new @ end[:3]
        dense.terms(end, 1.0)
        y = -h * simulation.contacts(state).forces[k]
        off = dense.g - y
        slides = np.linalg.norm((dense.J @ end)[:, :2], axis=1) > np.maximum(1e-3 * dense.w * dense.cone, 1e-3)
        stiff = np.where(slides, 0.0, dense.cone / np.maximum(1e-3 * dense.w * dense.cone, 1e-3))
        square = (off[:, :2] ** 2).sum(axis=1) / (1.0 / dense.w + stiff) + off[:, 2] ** 2 / (1.0 / dense.w + dense.G[:, 2, 2])
        assert reported[k] == pytest.approx(np.sqrt(square.sum() / rig.mass), rel=1e-5, abs=1e-12)
