"""Rigs with closed loops: against Pinocchio, against dense equations, and against what J and M say of each other."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from loop_rigs import bennett, bennett_angles, bricard, four_bar, guesses, pose
from random_trees import random_rig

import articulated as art
from articulated.crosscheck import PinocchioModel

MECHANISMS = list(guesses())
pytestmark = pytest.mark.usefixtures("interpreted")
WITH_AXIS = ("hinge", "slider", "universal", "cylindrical", "planar")


@cache
def mechanism(name):
    rig, loops, guess = guesses()[name]
    return rig, loops, art.assemble(rig, loops, guess)


def closed_states(name, count=5, seed=0):
    """Random states with loops closed in position and velocity, on the branch of the mechanism's own."""
    rig, loops, q0 = mechanism(name)
    rng = np.random.default_rng(seed)
    q = []
    while len(q) < count:
        guess = art.integrate(rig, q0, rng.uniform(-0.3, 0.3, rig.nv))
        try:
            q.append(art.assemble(rig, loops, guess, limits=False))
        except art.AssemblyError:
            continue
    q = np.array(q)
    v = art.project_velocity(rig, loops, q, rng.normal(size=(count, rig.nv)))
    return rig, loops, q, v, rng.normal(size=(count, rig.nv)), rng


class Cut:
    """A rig's loops as rigid constraints of a Pinocchio model; only points and welds can be."""

    def __init__(self, rig, loops):
        self.ref = PinocchioModel.from_rig(rig)
        self.loops, model = loops, self.ref.model
        self.models = pin.StdVec_RigidConstraintModel([self._model(rig, loop) for loop in loops])
        self.datas = pin.StdVec_RigidConstraintData([m.createData() for m in self.models])
        self.data = model.createData()
        pin.initConstraintDynamics(model, self.data, self.models, self.datas)

    def _model(self, rig, loop):
        kinds = {"point": pin.ContactType.CONTACT_3D, "weld": pin.ContactType.CONTACT_6D}
        ends = []
        for link, frame in zip((loop.link_a, loop.link_b), loop.frames, strict=True):
            if link is None:
                ends += [0, pin.SE3(frame)]
            else:
                at = self.ref.model.frames[self.ref.frame(link)]
                ends += [at.parentJoint, at.placement * pin.SE3(frame)]
        return pin.RigidConstraintModel(kinds[loop.kind], self.ref.model, *ends, pin.LOCAL)

    def solve(self, q, v, tau):
        """Accelerations and forces, as ours: on B."""
        ref = self.ref
        settings = pin.ProximalSettings(1e-13, 1e-13, 1e-9, 100)
        a = pin.constraintDynamics(
            ref.model,
            self.data,
            ref.q(q),
            ref.v(v),
            np.linalg.lstsq(ref.G.T, tau, rcond=None)[0],
            self.models,
            self.datas,
            settings,
        )
        forces = [-d.contact_force.vector[: len(loop.rows)] for d, loop in zip(self.datas, self.loops, strict=True)]
        return ref.G.T @ a, np.concatenate(forces)


def random_closed(seed, kind):
    """A random tree, two loops of this kind that a random state of it closes, and that state."""
    rng = np.random.default_rng(seed)
    rig = random_rig(3 * seed + seed % 3, armature=False, size=10)
    q, v, tau = rig.random(rng), rng.normal(size=rig.nv), rng.normal(size=rig.nv)
    X = art.link_poses(rig, q)
    links = list(rig.links.values())
    loops = []
    while len(loops) < 2:
        a, b = (links[k] for k in rng.choice(len(links), 2, replace=False))
        if a.body == b.body:
            continue
        A = pose(rng.normal(0, 0.3, 3), rng.normal(size=3))
        B = np.linalg.inv(X[b.index]) @ X[a.index] @ A
        if kind == "point":
            B = B @ pose(rotvec=rng.normal(size=3))
        loops.append(art.Loop(kind, a.name, A, b.name, B, name=str(len(loops))))
    return rig, loops, q, art.project_velocity(rig, loops, q, v), tau


def assert_agrees(rig, loops, q, v, tau):
    a, f = art.constrained_dynamics(rig, loops, q, v, tau)
    a_pin, f_pin = Cut(rig, loops).solve(q, v, tau)
    scale = max(1.0, np.abs(a_pin).max(), np.abs(f_pin).max())
    np.testing.assert_allclose(a, a_pin, atol=1e-8 * scale, rtol=0.0)
    J = art.loop_jacobian(rig, loops, q)
    np.testing.assert_allclose(J.T @ f, J.T @ f_pin, atol=1e-8 * scale, rtol=0.0)
    if np.linalg.matrix_rank(J, 1e-7) == len(J):
        np.testing.assert_allclose(f, f_pin, atol=1e-8 * scale, rtol=0.0)


@pytest.mark.parametrize("kind", ["point", "weld"])
@pytest.mark.parametrize("seed", range(12))
def test_constraint_dynamics_of_random_trees_against_pinocchio(seed, kind):
    assert_agrees(*random_closed(seed, kind))


POINTS = [name for name, (rig, _, _) in guesses().items() if not any(joint.mimic for joint in rig.joints.values())]


@pytest.mark.parametrize("name", POINTS)
def test_constraint_dynamics_of_mechanisms_against_pinocchio(name):
    """Their loops made points where they are closed: what Pinocchio has besides welds."""
    rig, loops, q, v, tau, _ = closed_states(name, 3)
    rig = rig.with_joints(armature=dict.fromkeys(rig.joints, 0.0))
    for k in range(len(q)):
        X, ties = art.link_poses(rig, q[k]), []
        for loop in loops:
            if loop.kind in ("point", "weld"):
                ties.append(loop)
            elif loop.kind != "gear":
                A, B = (np.eye(4) if link is None else X[rig.links[link].index] for link in (loop.link_a, loop.link_b))
                here = np.linalg.inv(B) @ A @ loop.frames[0]
                ties.append(art.Loop("point", loop.link_a, loop.frames[0], loop.link_b, here, name=loop.name))
        assert_agrees(rig, ties, q[k], art.project_velocity(rig, ties, q[k], v[k]), tau[k])


@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5, 7])
def test_constraint_dynamics_against_the_articulated_body_algorithm_with_constraints(seed):
    """Pinocchio's lcaba: Sathya, Carpentier 2024. With seed 3 it disagrees with its own constraintDynamics."""
    rig, loops, q, v, tau = random_closed(seed, "point")
    cut = Cut(rig, loops)
    ref, data = cut.ref, cut.ref.model.createData()
    datas = pin.StdVec_RigidConstraintData([m.createData() for m in cut.models])  # old ones make it crash
    pin.computeJointMinimalOrdering(ref.model, data, cut.models)
    settings = pin.ProximalSettings(1e-14, 1e-14, 0.1, 1000)  # a smaller μ costs it digits
    a = ref.G.T @ pin.lcaba(ref.model, data, ref.q(q), ref.v(v), ref.G @ tau, cut.models, datas, settings)
    ours, _ = art.constrained_dynamics(rig, loops, q, v, tau)
    np.testing.assert_allclose(ours, a, atol=1e-8 * np.abs(a).max(), rtol=0.0)


def random_loops(rig, rng):
    """One loop of each kind, open."""
    names, one = list(rig.links), [joint.name for joint in rig.joints.values() if joint.nq == 1]
    loops = []
    for kind in ("point", "hinge", "slider", "universal", "cylindrical", "planar", "weld", "distance"):
        a, b = rng.choice(names, 2, replace=False)
        while rig.links[a].body == rig.links[b].body:
            a, b = rng.choice(names, 2, replace=False)
        more = {"axis": rng.normal(size=3)} if kind in WITH_AXIS else {}
        more |= {"axis2": rng.normal(size=3)} if kind == "universal" else {}
        more |= {"length": 0.5} if kind == "distance" else {}
        ends = [pose(rng.normal(0, 0.3, 3), rng.normal(size=3)) for _ in range(2)]
        loops.append(art.Loop(kind, None if rig.links[a].body < 0 else a, ends[0], b, ends[1], name=kind, **more))
    if len(one) > 1:
        loops.append(art.Loop("gear", one[0], None, one[1], None, ratio=0.7, offset=0.1))
    return loops


@pytest.mark.parametrize("seed", range(12))
def test_rows_are_what_they_say(seed):
    """J is the derivative of the gaps, and accelerations bend them as their second derivative says, open as they may be."""
    rng = np.random.default_rng(seed)
    rig = random_rig(seed, mimic=seed % 2 == 0, armature=True, size=10)
    loops = random_loops(rig, rng)
    q, v, tau = rig.random(rng), rng.normal(size=rig.nv), rng.normal(size=rig.nv)
    J, e = art.loop_jacobian(rig, loops, q), 1e-6

    def gaps(dv):
        return art.loop_gaps(rig, loops, art.integrate(rig, q, dv))

    numeric = np.array([(gaps(e * d) - gaps(-e * d)) / (2 * e) for d in np.eye(rig.nv)]).T
    np.testing.assert_allclose(J, numeric, atol=3e-9)
    for loop in loops:  # one at a time: together they contradict each other
        J, h = art.loop_jacobian(rig, [loop], q), 1e-5
        if np.linalg.matrix_rank(J, 1e-6) < len(J):
            continue  # open as it is, no velocity may close it
        a, f = art.constrained_dynamics(rig, [loop], q, v, tau)

        def speeds(t, a=a, loop=loop):
            return art.loop_jacobian(rig, [loop], art.integrate(rig, q, t * v)) @ (v + t * a)

        bend = (speeds(h) - speeds(-h)) / (2 * h)
        np.testing.assert_allclose(bend, 0.0, atol=1e-7 * max(1.0, np.abs(J).max() * np.abs(a).max()))
        M, C = art.mass_matrix(rig, q), art.bias_forces(rig, q, v)
        np.testing.assert_allclose(M @ a + C, tau + J.T @ f, atol=1e-9 * max(1.0, np.abs(f).max()))
        if loop.kind != "gear" and loop.link_a is not None and rig.root == "free":
            np.testing.assert_allclose((J.T @ f)[:6], 0.0, atol=1e-11 * max(1.0, np.abs(f).max()))  # no loop pulls itself along


@pytest.mark.parametrize("name", MECHANISMS)
def test_accelerations_keep_mechanisms_closed(name):
    rig, loops, q, v, tau, _ = closed_states(name, 4)
    a, f = art.constrained_dynamics(rig, loops, q, v, tau)
    M, C, J = art.mass_matrix(rig, q), art.bias_forces(rig, q, v), art.loop_jacobian(rig, loops, q)
    dense = dense_accelerations(rig, loops, q, v, tau)
    size = np.abs(dense).max()
    np.testing.assert_allclose(a, dense, atol=1e-7 * size)
    left = np.einsum("bij,bj->bi", M, a) + C - tau - np.einsum("bji,bj->bi", J, f)
    np.testing.assert_allclose(left, 0.0, atol=1e-9 * np.abs(f).max())
    # what moves by these accelerations stays closed to third order
    gaps = []
    for h in (2e-3, 1e-3):
        gaps.append(np.abs(art.loop_gaps(rig, loops, art.integrate(rig, q, h * v + 0.5 * h * h * a))).max())
    assert gaps[1] < 0.2 * gaps[0] or gaps[0] < 1e-12


def dense_accelerations(rig, loops, q, v, tau):
    """Of the dense equations, by least squares, with J̇ v from differences."""
    result, h = [], 1e-5
    for q1, v1, tau1 in zip(q, v, tau, strict=True):
        J = art.loop_jacobian(rig, loops, q1)
        later, before = (art.loop_jacobian(rig, loops, art.integrate(rig, q1, s * h * v1)) @ v1 for s in (1, -1))
        M, C, n = art.mass_matrix(rig, q1), art.bias_forces(rig, q1, v1), len(J)
        K = np.block([[M, J.T], [J, np.zeros((n, n))]])
        result.append(np.linalg.lstsq(K, np.concatenate([tau1 - C, -(later - before) / (2 * h)]), rcond=1e-11)[0][: rig.nv])
    return np.array(result)


def test_planar_loop_of_five_rows_is_that_of_two():
    rig = four_bar()
    rng = np.random.default_rng(0)
    for angle in rng.uniform(-3.0, 3.0, 20):
        q = art.assemble(rig, None, [angle, -0.4 - 0.3 * angle, 1.6], hold="j1")
        v = art.project_velocity(rig, None, q, 5.0 * rng.normal(size=3))
        tau = rng.normal(size=3)
        a, _ = art.constrained_dynamics(rig, None, q, v, tau)
        assert np.linalg.matrix_rank(art.loop_jacobian(rig, None, q), 1e-9) == 2
        bend = planar_bend(q, v)
        K = np.block([[art.mass_matrix(rig, q), two_rows(q).T], [two_rows(q), np.zeros((2, 2))]])
        expected = np.linalg.solve(K, np.concatenate([tau - art.bias_forces(rig, q, v), -bend]))[:3]
        np.testing.assert_allclose(a, expected, atol=1e-9 * np.abs(expected).max(), rtol=0.0)


def two_rows(q):
    """d/dq of coupler end less rocker end, in the plane."""
    th, th2, ph = q[0], q[0] + q[1], q[2]
    dx = [-0.3 * np.sin(th) - 0.9 * np.sin(th2), -0.9 * np.sin(th2), 0.7 * np.sin(ph)]
    dz = [0.3 * np.cos(th) + 0.9 * np.cos(th2), 0.9 * np.cos(th2), -0.7 * np.cos(ph)]
    return np.array([dx, dz])


def planar_bend(q, v):
    w1, w2, w3 = v[0], v[0] + v[1], v[2]
    x = [-0.3 * np.cos(q[0]), -0.9 * np.cos(q[0] + q[1]), 0.7 * np.cos(q[2])]
    z = [-0.3 * np.sin(q[0]), -0.9 * np.sin(q[0] + q[1]), 0.7 * np.sin(q[2])]
    squares = np.array([w1 * w1, w2 * w2, w3 * w3])
    return np.array([x @ squares, z @ squares])


def test_singular_and_redundant_loops_are_finite():
    rig = bricard()
    q = np.zeros(rig.nv)
    twice = [
        *rig.loops,
        art.Loop("hinge", None, rig.loops[0].frames[0], "rod4", rig.loops[0].frames[1], axis=(0, 0, 1), name="again"),
    ]
    a, f = art.constrained_dynamics(rig, None, q, q, q)
    b, g = art.constrained_dynamics(rig, twice, q, q, q)
    np.testing.assert_allclose(a, b, atol=1e-9 * np.abs(a).max())
    np.testing.assert_allclose(g[:5], g[5:], atol=1e-4)  # each bears half
    np.testing.assert_allclose(g[:5] + g[5:], f, atol=1e-4)


@pytest.mark.parametrize("name", MECHANISMS)
def test_projected_velocities_are_the_nearest(name):
    rig, loops, q, _, _, rng = closed_states(name, 4)
    v = rng.normal(size=(4, rig.nv))
    w, M, J = art.project_velocity(rig, loops, q, v), art.mass_matrix(rig, q), art.loop_jacobian(rig, loops, q)
    np.testing.assert_allclose(np.einsum("bij,bj->bi", J, w), 0.0, atol=1e-9)
    for k in range(4):  # the impulse is one of loops
        impulse = M[k] @ (w[k] - v[k])
        assert np.linalg.norm(impulse - J[k].T @ np.linalg.lstsq(J[k].T, impulse, rcond=1e-9)[0]) < 1e-7 * np.linalg.norm(
            impulse
        )


@pytest.mark.parametrize("name", ["four bar", "strandbeest", "delta", "scissor", "crane", "car", "bar"])
def test_inverse_dynamics_gives_what_forward_dynamics_needs(name):
    rig, loops, q, v, tau, _ = closed_states(name, 3)
    a, _ = art.constrained_dynamics(rig, loops, q, v, tau)
    everything = list(rig.joints)
    wanted, _ = art.constrained_inverse_dynamics(rig, loops, q, v, a, actuated=everything)
    assert (np.linalg.norm(wanted, axis=-1) <= np.linalg.norm(tau, axis=-1) * (1 + 1e-9)).all()
    again, _ = art.constrained_dynamics(rig, loops, q, v, wanted)
    np.testing.assert_allclose(again, a, atol=1e-6 * np.abs(a).max())


def test_inverse_dynamics_of_one_motor():
    rig, loops, q, v, _, rng = closed_states("four bar", 5)
    tau = np.zeros((5, 3))
    tau[:, 0] = rng.normal(size=5)
    a, f = art.constrained_dynamics(rig, loops, q, v, tau)
    found, g = art.constrained_inverse_dynamics(rig, loops, q, v, a, actuated=["j1"])
    np.testing.assert_allclose(found, tau, atol=1e-9)
    np.testing.assert_allclose(g, f, atol=1e-8)
    with pytest.warns(RuntimeWarning, match="cannot give this acceleration"):
        art.constrained_inverse_dynamics(rig, [], q, v, a, actuated=["j1"])


def test_bennett_follows_its_own_relation():
    rig = bennett()
    for theta in np.linspace(0.5, 2.5, 9):
        q = bennett_angles(theta)
        assert np.abs(art.loop_gaps(rig, None, q)).max() < 1e-13
        assert np.linalg.matrix_rank(art.loop_jacobian(rig, None, q), 1e-9) == 2


@pytest.mark.parametrize("name", ["four bar", "delta", "crane", "gears", "bar"])
def test_compiled_is_as_interpreted(name, monkeypatch):
    monkeypatch.delenv("ARTICULATED_INTERPRET", raising=False)
    rig, loops, q, v, tau, rng = closed_states(name, 9)
    u = rng.normal(size=v.shape)

    def results(dtype=np.float64):
        q1, v1, tau1, u1 = (x.astype(dtype) for x in (q, v, tau, u))
        a, f = art.constrained_dynamics(rig, loops, q1, v1, tau1)
        kinematics = (
            art.loop_gaps(rig, loops, q1),
            art.loop_jacobian(rig, loops, q1),
            art.project_velocity(rig, loops, q1, u1),
        )
        return [a, f, *kinematics]

    compiled, single = results(), results(np.float32)
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    for x, y, expected in zip(compiled, single, results(), strict=True):
        size = max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(x, expected, atol=1e-8 * size)
        assert y.dtype == np.float32
        np.testing.assert_allclose(y, expected, atol=1e-2 * size)
