"""Contacts between bodies: the implicit step's solution against a dense solver of the same problem."""

from __future__ import annotations

import os

import numpy as np
import pytest
from dense_step import Dense, under_way
from pair_rigs import boxes, crumpled, free, loose, put
from scipy.spatial.transform import Rotation

import articulated as art
from articulated.dynamics.tree import tree
from articulated.simulation.contact.meeting import touches
from articulated.simulation.implicit import newton

H, FRICTION, STIFFNESS = 0.002, 0.7, 5e4
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
    put(rig, q, 1, rng.uniform([-0.1, -0.1, 0.9], [0.1, 0.1, 1.1], (STATES, 3)))
    parts = ("torso", "*forearm")
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


def dense_of(simulation, friction, h, q):
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

    material = art.Material(friction=friction, stiffness=STIFFNESS)
    return lambda k: _dense(rig, points, ends, *of(k), material, h)


def _dense(rig, points, ends, found, near, material, h):
    """Without what is far apart, which answers nothing."""
    pairs, some, none = [ends[n] for n in near], [found[n] for n in near], np.zeros(rig.nv)
    return Dense(
        rig, points, material, h, none, none, rig.neutral(), None, None, before=h, pairs=pairs, touches=lambda _: some
    ), near


def at_start(rig, q, q_new, v):
    """Velocities with free roots' in the axes that they had at the start of the step."""
    v, X, X_new = v.copy(), art.link_poses(rig, q), art.link_poses(rig, q_new)
    for joint in free(rig):
        k, s = rig.links[joint.child].index, joint.v_slice.start
        turn = np.swapaxes(X[:, k, :3, :3], 1, 2) @ X_new[:, k, :3, :3]
        for part in (slice(s, s + 3), slice(s + 3, s + 6)):
            v[:, part] = np.einsum("nij,nj->ni", turn, v[:, part])
    return v


def scene(name, friction=FRICTION):
    """In full contact; with configurations and velocities."""
    rig, q, v, pairs = SCENES[name](np.random.default_rng(5))
    collisions = art.Collisions(friction=friction, stiffness=STIFFNESS, pairs=pairs)
    ground = art.Ground(friction=friction, stiffness=STIFFNESS)
    settings = {"dt": H, "limits": False, "tolerance": 1e-12}
    return art.Simulation(rig.with_joints(damping=0.0), ground=ground, collisions=collisions, **settings), q, v


def assert_solved(simulation, state, q, v, friction=FRICTION, limits=None):
    """A step's new state equals the dense solution, with the friction limits that the step found, if they are given."""
    assert simulation.residual(state).max() < 1e-10
    got, dense, touched, worst = at_start(simulation.rig, q, state.q, state.v), dense_of(simulation, friction, H, q), 0, []
    for k in range(len(q)):
        problem, near = dense(k)
        ground = len(problem.points)
        cones = None if limits is None else limits[k][[*range(ground), *(ground + near)]]
        expected = problem.solve(q[k], v[k], cones=cones)
        worst.append(np.abs(got[k] - expected).max() / np.abs(expected).max())
        pushes = problem.push(problem.hinges, (problem.J @ expected)[:, 2])[0]
        touched += bool((pushes[ground:] > 0.0).any())
    assert max(worst) < 1e-9, (int(np.argmax(worst)), sorted(worst)[-10:])
    assert touched > 0.4 * len(q)


@pytest.mark.parametrize("name", SCENES)
def test_solution_is_that_of_a_dense_solver(name):
    simulation, q, v = scene(name)
    assert not simulation._world.scene.iterates
    assert_solved(simulation, simulation.step(under_way(simulation, simulation.reset(q, v))), q, v)


@pytest.fixture
def nothing_is_factored(monkeypatch):
    """Whatever couples bodies is solved by iteration."""
    monkeypatch.setattr("articulated.simulation.scene.MOST_FILL", 0)


def test_iterations_end_at_the_solution_of_a_dense_solver(nothing_is_factored):
    simulation, q, v = scene("pile", friction=0.0)
    assert simulation._world.scene.iterates
    assert_solved(simulation, simulation.step(under_way(simulation, simulation.reset(q, v))), q, v, friction=0.0)


def test_iterations_with_friction_end_at_the_solution_of_a_dense_solver(nothing_is_factored, monkeypatch):
    """When iterations end depends on rounding, and with it the friction limits: the dense solver is given those that were found."""
    simulation, q, v = scene("pile")
    limits = []

    def solved(*args, **settings):
        found = newton.solved(*args, **settings)
        limits[:] = found.limits
        return found

    monkeypatch.setattr("articulated.simulation.implicit.step.solved", solved)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    with np.errstate(all="ignore"):
        state = simulation.step(under_way(simulation, simulation.reset(q, v)))
    found = np.nan_to_num(np.array([np.broadcast_to(x, len(q)) for x in limits]).T)
    assert_solved(simulation, state, q, v, limits=found)
