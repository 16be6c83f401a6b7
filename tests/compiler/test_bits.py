"""A state's result has the same bits wherever, with whomever and on whatever vector instructions it is computed."""

from __future__ import annotations

import hashlib
import os

import numpy as np
import pytest
from contact_rigs import chain
from loop_rigs import table
from pair_rigs import loose, put
from random_trees import random_rig

import articulated as art
from articulated.compiler.machine import _levels
from articulated.dynamics.functions import programs


@pytest.fixture(scope="module")
def rig():
    return random_rig(5, mimic=True, armature=False, size=9).with_joints(damping=0.1, friction=0.05)


@pytest.fixture(scope="module", params=[np.float64, np.float32])
def inputs(rig, request):
    rng = np.random.default_rng(1)
    arrays = (rig.random(rng, 33), *rng.normal(size=(2, 33, rig.nv)), rng.normal(size=(33, rig.nlinks, 6)))
    return tuple(x.astype(request.param) for x in arrays)


@pytest.fixture(scope="module")
def reference(rig, inputs):
    q, v, tau, external = inputs
    return art.forward_dynamics(rig, q, v, tau, external)


@pytest.mark.parametrize("count", range(1, 34))
def test_every_batch_size(rig, inputs, reference, count):
    for first in {0, 33 - count}:
        part = [x[first : first + count] for x in inputs]
        assert art.forward_dynamics(rig, *part).tobytes() == reference[first : first + count].tobytes()


def test_one_state_alone(rig, inputs, reference):
    for k in range(33):
        assert art.forward_dynamics(rig, *(x[k] for x in inputs)).tobytes() == reference[k].tobytes()


def test_every_position(rig, inputs, reference, rng):
    for _ in range(10):
        order = rng.permutation(33)
        assert art.forward_dynamics(rig, *(x[order] for x in inputs)).tobytes() == reference[order].tobytes()


@pytest.mark.parametrize("threads", [1, 2, 3, 7, 100, None])
def test_threads(rig, inputs, threads):
    many = [np.tile(x, (31, *[1] * (x.ndim - 1))) for x in inputs]
    result = art.forward_dynamics(rig, *many, threads=threads)
    assert result.tobytes() == art.forward_dynamics(rig, *many, threads=1).tobytes()


@pytest.mark.parametrize("level", list(_levels()))
def test_every_level_of_vector_instructions(rig, inputs, level, monkeypatch):
    """All functions, in new rigs, so that nothing compiled before is used."""
    q, v, tau, external = inputs

    def everything(rig) -> dict[str, bytes]:
        given = {"q": q, "q0": q, "q1": q[::-1], "v": v, "tau": tau, "a": tau, "dv": tau}
        functions = {
            name: getattr(art, name)(rig, *(given[a.name] for a in program.arguments)).tobytes()
            for name, program in programs(rig).items()
        }
        return functions | {"external": art.forward_dynamics(rig, q, v, tau, external).tobytes()}

    expected = everything(rig)
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    assert everything(rig.with_joints(damping=0.1)) == expected


@pytest.mark.parametrize("level", list(_levels()))
@pytest.mark.parametrize("single", [False, True])
def test_contact_at_every_level(level, single, monkeypatch):
    """Steps with contact end after different numbers of sweeps, in groups of different sizes."""
    slope = np.add.outer(0.1 * np.arange(9.0), 0.05 * np.arange(9.0) ** 2)
    ground = art.Ground([art.HeightField(slope, 0.1, (-0.4, -0.4, -0.5)), art.Plane()], restitution=0.4)

    def run() -> bytes:
        rig = chain(4).with_joints(damping=0.01, friction=0.01)
        drives = art.PD(stiffness=1.0, damping=0.01, limit=0.2)
        simulation = art.Simulation(rig, ground=ground, limits=art.Stops(restitution=0.5), actuation=drives)
        q, v = rig.random(0, 21), 2.0 * np.random.default_rng(0).normal(size=(21, rig.nv))
        q[:, 2] = 0.5
        dtype = np.float32 if single else np.float64
        state = simulation.reset(q.astype(dtype), v.astype(dtype))
        for _ in range(150):
            state = simulation.step(state, q)
        assert len(set(state.memory[:, -1].tolist())) > 5
        return state.q.tobytes() + state.v.tobytes() + simulation.contacts(state).forces.tobytes()

    expected = run()
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    assert run() == expected


@pytest.mark.parametrize("level", list(_levels()))
@pytest.mark.parametrize("single", [False, True])
def test_loops_at_every_level(level, single, monkeypatch):
    ground = art.Ground(art.Plane((0, 0, 1), (0, 0, -0.1)))

    def run() -> bytes:
        rig = table().with_joints(damping=0.01)
        rope = art.Loop("distance", None, (0.5, 0, 0.3), "plate", None, length=0.45, rope=True, name="rope")
        q, v = np.tile(art.assemble(rig, [*rig.loops, rope]), (21, 1)), 2.0 * np.random.default_rng(0).normal(size=(21, rig.nv))
        dtype, result = np.float32 if single else np.float64, b""
        for settings in ({"integrator": "rk4"}, {"ground": ground, "contact_points": [art.ContactPoint("plate", (0.3, 0, 0))]}):
            simulation = art.Simulation(rig, loops=[*rig.loops, rope], **settings)
            state = simulation.reset(q.astype(dtype), v.astype(dtype))
            for _ in range(50):
                state = simulation.step(state)
            assert np.abs(simulation.loop_forces(state)).max() > 0.0
            result += state.q.tobytes() + state.v.tobytes() + state.memory.tobytes()
        return result

    expected = run()
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    assert run() == expected


@pytest.mark.parametrize("level", list(_levels()))
@pytest.mark.parametrize(("single", "fill"), [(False, 0), (True, 22_000)])
def test_pairs_at_every_level(level, single, fill, monkeypatch):
    """A chain, a box and a ball, solved directly and by iteration; each state alone and among others."""
    monkeypatch.setattr("articulated.simulation.scene.MOST_FILL", fill)
    loose_ones = (art.Sphere(0.06), art.Sphere(0.05)) if single else (art.Box((0.1, 0.1, 0.1)), art.Sphere(0.05))
    box, ball = (loose(shape, 0.5) for shape in loose_ones)
    rig = art.compose(chain=chain(2), box=box, ball=ball)
    q, v = np.tile(rig.neutral(), (21, 1)), 2.0 * np.random.default_rng(0).normal(size=(21, rig.nv))
    chain_at, box_at, ball_at = range(3)
    put(rig, q, chain_at, (0.0, 0.0, 0.1))
    put(rig, q, box_at, np.random.default_rng(1).uniform([0.0, -0.1, 0.2], [0.3, 0.1, 0.3], (21, 3)))
    put(rig, q, ball_at, np.random.default_rng(2).uniform([0.0, -0.1, 0.4], [0.3, 0.1, 0.5], (21, 3)))
    dtype = np.float32 if single else np.float64
    q, v = q.astype(dtype), v.astype(dtype)

    def run(some=slice(None), threads=1) -> bytes:
        collisions = art.Collisions(restitution=0.3 if single else 0.0)
        simulation = art.Simulation(rig.with_joints(damping=0.01), ground=True, collisions=collisions, threads=threads)
        state = simulation.reset(q[some], v[some])
        for _ in range(150):
            state = simulation.step(state)
        stance, first = simulation._world.layout.stance, rig.nq + rig.nv + 1
        near = {tuple(pattern) for pattern in state.memory[:, [stance.near - first, stance.met - first]].tolist()}
        assert isinstance(some, list) or len(near) > 5
        return state.q.tobytes() + state.v.tobytes()

    expected = run()
    if level == next(iter(_levels())):
        size = rig.nq * q.itemsize
        for k in (3, 20):
            assert run([k])[:size] == expected[k * size : (k + 1) * size]
        assert run(threads=3) == expected
    monkeypatch.setenv("ARTICULATED_SIMD", level)
    assert run() == expected


def test_unknown_level(monkeypatch):
    monkeypatch.setenv("ARTICULATED_SIMD", "mmx")
    with pytest.raises(ValueError, match=r"ARTICULATED_SIMD is 'mmx'; this processor has .*sse2|neon"):
        art.forward_dynamics(art.load("cartpole"), np.zeros((2, 2)), np.zeros(2), np.zeros(2))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_a_bad_state_leaves_the_others_untouched(rig, inputs, bad):
    """Through a whole function; numbers that are not finite are refused at the surface, so this looks below it."""
    from articulated.dynamics.boundary import Argument
    from articulated.dynamics.calls import call
    from articulated.dynamics.functions import _forward_dynamics

    def run(v):
        names = ("q", inputs[0]), ("v", v), ("tau", inputs[2])
        arguments = [Argument(name, x, x.shape[1:]) for name, x in names]
        arguments += [Argument("external", None, ()), Argument("gravity", art.GRAVITY, (3,))]
        return call(rig, _forward_dynamics, arguments, (rig.nv,), None, 1, watched=False, joint_forces=False)

    clean = run(inputs[1])
    for k in range(33):
        with np.errstate(over="ignore"):
            v = inputs[1].copy()
            v[k, 2] = bad
        others = np.arange(33) != k
        assert run(v)[others].tobytes() == clean[others].tobytes()


@pytest.mark.parametrize("integrator", art.INTEGRATORS)
def test_runs(rig, integrator, rng):
    """A run of many states, each of them alone, and period by period: the same bits."""
    simulation = art.Simulation(rig, dt=0.004, substeps=2, integrator=integrator, rtol=1e-4)
    q, v = rig.random(rng, 5), rng.normal(size=(5, rig.nv))
    tau = rng.normal(size=(5, 6, rig.nv))
    run = simulation.run(q, v, duration=0.05, fps=60, control=tau)
    for k in range(5):
        alone = simulation.run(q[k], v[k], duration=0.05, fps=60, control=tau[k])
        assert (alone.q.tobytes(), alone.v.tobytes()) == (run.q[k].tobytes(), run.v[k].tobytes())
        assert alone.work.tobytes() == run.work[k].tobytes()
    asked = simulation.run(q, v, duration=0.05, fps=60, control=lambda t, state: tau[:, int(t * 120 + 1e-6)])
    assert (asked.q.tobytes(), asked.v.tobytes()) == (run.q.tobytes(), run.v.tobytes())


def test_long_run(monkeypatch):
    """A second of the ragdoll falling apart in 11 states: one hash for every level of vector instructions, and for one thread or two."""
    hashes = set()
    for level in _levels():
        monkeypatch.setenv("ARTICULATED_SIMD", level)
        for threads in (1, 2):
            rig = art.load("ragdoll", root="free").with_joints(damping=0.3)
            run = art.Simulation(rig, dt=0.004, threads=threads).run(rig.random(3, 11), duration=1.0, fps=50)
            hashes.add(hashlib.sha256(run.q.tobytes() + run.v.tobytes() + run.energy.tobytes()).hexdigest())
    assert len(hashes) == 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_threads_after_a_fork(rig, inputs, reference):
    many = [np.tile(x, (31, *[1] * (x.ndim - 1))) for x in inputs]
    expected = art.forward_dynamics(rig, *many, threads=2)
    child = os.fork()
    if child == 0:
        os._exit(0 if art.forward_dynamics(rig, *many, threads=2).tobytes() == expected.tobytes() else 1)
    assert os.waitpid(child, 0)[1] == 0
