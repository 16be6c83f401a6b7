"""Contacts between bodies: the implicit step's solution against a dense solver of the same problem."""

from __future__ import annotations

import dataclasses
import os

import numpy as np
import pytest
from dense_step import Dense
from pair_rigs import boxes, crumpled, free, loose, put
from scipy.spatial.transform import Rotation

import articulated as art
from articulated.dynamics.tree import tree
from articulated.simulation.contact.meeting import touches
from articulated.simulation.implicit import newton as solver

H, FRICTION, STIFFNESS = 0.002, 0.7, 5e4
MATERIAL = art.Material(friction=FRICTION, stiffness=STIFFNESS)
STATES = int(os.environ.get("ARTICULATED_STATES", "12"))
NEAR = 0.05
"""What is farther apart answers nothing in a step [m]."""


def limbs_crossed(rng):
    """A ragdoll with limbs in each other, near the ground."""
    rig, q = crumpled(rng, STATES)
    limbs = [("*forearm", "torso"), ("*forearm", "head"), ("*forearm", "*thigh"), ("*forearm", "*_forearm"), ("*shin", "*shin")]
    return rig, on_ground(rig, q, rng), rng.normal(size=(STATES, rig.nv)), [*limbs, ("*thigh", "*thigh"), ("*thigh", "torso")]


def two_ragdolls(rng):
    """Which have run into each other."""
    one, q = crumpled(rng, 2 * STATES, reach=0.4)
    rig = art.compose(left=one, right=one)
    q = np.concatenate([q[:STATES], q[STATES:]], axis=1)
    put(rig, q, 0, (0.0, 0.0, 1.0))
    put(rig, q, 1, rng.uniform([-0.2, -0.2, 0.9], [0.2, 0.2, 1.1], (STATES, 3)))
    parts = ("torso", "head", "*forearm")
    pairs = [(f"left/{a}", f"right/{b}") for a in parts for b in parts]
    return rig, q, rng.normal(size=(STATES, rig.nv)), pairs


def ragdoll_and_ball(rng):
    """A heavy ball that hits somewhere."""
    one, q = crumpled(rng, STATES, reach=0.4)
    rig = art.compose(one, ball=loose(art.Sphere(0.15), 5.0))
    ball = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (STATES, 1))
    q = np.concatenate([q, ball], axis=1)
    put(rig, q, 0, (0.0, 0.0, 1.0))
    put(rig, q, 1, rng.uniform([-0.25, -0.25, 0.7], [0.25, 0.25, 1.5], (STATES, 3)))
    return rig, q, rng.normal(size=(STATES, rig.nv)), [("ball/*", "ragdoll/*")]


def stack(rng):
    """Five boxes on each other, a little askew, pushed."""
    rig = boxes(5)
    q = np.tile(rig.neutral(), (STATES, 1))
    for k in range(5):
        place = np.column_stack([rng.normal(scale=0.01, size=(STATES, 2)), np.full(STATES, 0.0995 + 0.1995 * k)])
        put(rig, q, k, place, Rotation.from_rotvec(rng.normal(size=(STATES, 3)) * [2e-3, 2e-3, 0.3]))
    return rig, q, 0.5 * rng.normal(size=(STATES, rig.nv)), [("*", "*")]


def pile(rng):
    """Five boxes that lie about in a small place."""
    rig = boxes(5)
    q = np.tile(rig.neutral(), (STATES, 1))
    for k in range(5):
        put(rig, q, k, rng.uniform([-0.2, -0.2, 0.12], [0.2, 0.2, 0.5], (STATES, 3)), Rotation.random(STATES, random_state=k))
    return rig, q, rng.normal(size=(STATES, rig.nv)), [("*", "*")]


def on_ground(rig, q, rng):
    q = q.copy()
    put(rig, q, 0, (0.0, 0.0, 0.0))
    simulation = art.Simulation(rig, ground=True, limits=False)
    q[:, 2] -= simulation.contacts(simulation.reset(q)).gaps.min(axis=1) + rng.uniform(0.0, 0.005, len(q))
    return q


SCENES = {f.__name__: f for f in (limbs_crossed, two_ragdolls, ragdoll_and_ball, stack, pile)}


def dense_of(simulation, h, q):
    """The dense problem of a simulation without drives, damping or stops; for one of the configurations at a time."""
    scene, rig = simulation._world.scene, simulation.rig
    m, names, candidates = scene.mechanism, list(rig.links), scene.candidates
    points = [art.ContactPoint(names[c.link], c.center, c.radius) for c in candidates]
    assert all(c.axis is None for c in candidates)
    ends = []
    for n, pair in enumerate(scene.pair_of):
        a, b = scene.pieces[pair.a], scene.pieces[pair.b]
        link = [None if piece.body(m) < 0 else names[piece.link] for piece in (a, b)]
        ends.append((*link, a.round, b.round, scene.felt(scene.touches + n)))
    now, found = tree(m, list(q.T)), []
    for touch in touches(now, scene.pieces, scene.pairs):
        vectors = (touch.normal, touch.point + now.origin)
        found.append([np.broadcast_to(x, len(q)) for x in (touch.size, *(x for vector in vectors for x in vector))])
    found = np.moveaxis(np.array(found), -1, 0)

    def of(k):
        return [(x[0], x[1:4], x[4:7]) for x in found[k]], np.flatnonzero(found[k, :, 0] < NEAR)

    none = np.zeros(rig.nv)
    return lambda k: _dense(rig, points, ends, *of(k), h, none)


def _dense(rig, points, ends, found, near, h, none):
    """Without what is far apart, which answers nothing."""
    pairs, some = [ends[n] for n in near], [found[n] for n in near]
    return Dense(
        rig, points, MATERIAL, h, none, none, rig.neutral(), None, None, before=h, pairs=pairs, touches=lambda _: some
    ), near


def under_way(simulation, state):
    """The same states, as if a step had led to them."""
    memory = state.memory.copy()
    memory[..., simulation._world.layout.stance.before - (simulation.rig.nq + simulation.rig.nv + 1)] = simulation.dt
    return dataclasses.replace(state, memory=memory)


def at_start(rig, q, q_new, v):
    """Velocities with free roots' in the axes that they had at the start of the step."""
    v, X, X_new = v.copy(), art.link_poses(rig, q), art.link_poses(rig, q_new)
    for joint in free(rig):
        k, s = rig.links[joint.child].index, joint.v_slice.start
        turn = np.swapaxes(X[:, k, :3, :3], 1, 2) @ X_new[:, k, :3, :3]
        for part in (slice(s, s + 3), slice(s + 3, s + 6)):
            v[:, part] = np.einsum("nij,nj->ni", turn, v[:, part])
    return v


@pytest.mark.parametrize(("name", "fill"), [*((name, None) for name in SCENES), ("pile", 0)])
def test_solution_is_that_of_a_dense_solver(name, fill, monkeypatch):
    """In full contact; solved directly, or by iteration, if a factorisation may take no more than `fill` operations.

    Iterations find other friction cones, which depend on the way to the solution: the dense solver is given these.
    """
    if fill is not None:
        monkeypatch.setattr("articulated.simulation.scene.MOST_FILL", fill)
    rig, q, v, pairs = SCENES[name](np.random.default_rng(5))
    rig = rig.with_joints(damping=0.0)
    collisions = art.Collisions(friction=FRICTION, stiffness=STIFFNESS, pairs=pairs)
    ground = art.Ground(friction=FRICTION, stiffness=STIFFNESS)
    simulation = art.Simulation(rig, dt=H, ground=ground, limits=False, tolerance=1e-12, collisions=collisions)
    assert simulation._world.scene.iterates == (fill == 0)
    state = simulation.step(under_way(simulation, simulation.reset(q, v)))
    assert simulation.residual(state).max() < 1e-10
    cones = cones_of(simulation, q, v, monkeypatch) if simulation._world.scene.iterates else [None] * len(q)
    got, dense, touched, worst = at_start(rig, q, state.q, state.v), dense_of(simulation, H, q), 0, []
    for k in range(len(q)):
        problem, near = dense(k)
        ground = len(problem.points)
        some = None if cones[k] is None else cones[k][[*range(ground), *(ground + near)]]
        expected = problem.solve(q[k], v[k], cones=some)
        worst.append(np.abs(got[k] - expected).max() / np.abs(expected).max())
        pushes = problem.push(problem.hinges, (problem.J @ expected)[:, 2])[0]
        touched += bool((pushes[ground:] > 0.0).any())
    # when iterations end depends on rounding, and so do the cones
    assert max(worst) < (1e-9 if fill is None else 1e-6), (int(np.argmax(worst)), sorted(worst)[-10:])
    assert touched > 0.2 * len(q)


def cones_of(simulation, q, v, monkeypatch):
    """The limits of the friction cones that a step finds, shape (states, contacts)."""
    limits = []

    def solved(*args, **settings):
        found = solver.solved(*args, **settings)
        limits[:] = found.limits
        return found

    monkeypatch.setattr("articulated.simulation.implicit.step.solved", solved)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    with np.errstate(all="ignore"):
        simulation.step(under_way(simulation, simulation.reset(q, v)))
    monkeypatch.delenv("ARTICULATED_INTERPRET")
    return np.nan_to_num(np.array([np.broadcast_to(x, len(q)) for x in limits]).T)
