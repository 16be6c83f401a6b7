"""Identities that need no other engine, on random rigs and states."""

from __future__ import annotations

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art

SEEDS = range(2000, 2040)
N = 8


@pytest.fixture(autouse=True)
def mostly_interpreted(request):
    """One rig in eight is compiled, and what has no seed."""
    parameters = request.node.callspec.params if hasattr(request.node, "callspec") else {}
    if parameters.get("seed", 0) % 8:
        request.getfixturevalue("interpreted")


def states(rig: art.Rig, seed: int):
    rng = np.random.default_rng(seed)
    q = rig.random(rng, N)
    return (rng, q, *(rng.normal(size=(N, rig.nv)) for _ in range(3)))


def rig_of(seed: int) -> art.Rig:
    """All sorts: a third with followers, a third with armature, a third with both."""
    return random_rig(seed, mimic=seed % 3 != 1, armature=seed % 3 != 0)


def close(actual, expected, rig, q, tolerance=1e-14) -> None:
    """Equal, but for what the mass matrix amplifies of a rounding error."""
    condition = np.linalg.cond(art.mass_matrix(rig, q)).max()
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * condition * np.abs(expected).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_forward_dynamics_inverts_inverse_dynamics(seed):
    rig = rig_of(seed)
    rng, q, v, a, _ = states(rig, seed)
    external = rng.normal(size=(N, rig.nlinks, 6))
    gravity = rng.normal(size=3)
    tau = art.inverse_dynamics(rig, q, v, a, external, gravity)
    close(art.forward_dynamics(rig, q, v, tau, external, gravity), a, rig, q)


@pytest.mark.parametrize("seed", SEEDS)
def test_equation_of_motion(seed):
    rig = rig_of(seed)
    _, q, v, a, tau = states(rig, seed)
    M, bias = art.mass_matrix(rig, q), art.bias_forces(rig, q, v)
    np.testing.assert_array_equal(M, np.swapaxes(M, -1, -2))
    assert np.linalg.eigvalsh(M).min() > 0
    M_a = np.einsum("nij,nj->ni", M, a)
    np.testing.assert_allclose(M_a + bias, art.inverse_dynamics(rig, q, v, a), atol=1e-11)
    a = art.forward_dynamics(rig, q, v, tau)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", M, a) + bias, tau, atol=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_power_of_all_forces_is_the_rate_of_energy(seed):
    rig = rig_of(seed).with_joints(damping=0.3, friction=0.2)
    rng, q, v, _, tau = states(rig, seed)
    external = rng.normal(size=(N, rig.nlinks, 6))
    a = art.forward_dynamics(rig, q, v, tau, external, joint_forces=True)

    def energy(t: float) -> np.ndarray:
        q_t = art.integrate(rig, q, t * v + 0.5 * t * t * a)
        return art.kinetic_energy(rig, q_t, v + t * a) + art.potential_energy(rig, q_t)

    h = 1e-3  # a derivative of order 6: its truncation is about 1e-13 and its rounding too
    rate = sum(w * (energy(k * h) - energy(-k * h)) for k, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))) / h
    power = ((tau + art.passive_forces(rig, v)) * v).sum(axis=-1)
    power += (external * art.link_velocities(rig, q, v)).sum(axis=(-1, -2))
    np.testing.assert_allclose(rate, power, rtol=0, atol=1e-8 * np.abs(power).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_jacobian_is_the_velocity_of_its_point(seed):
    rig = rig_of(seed)
    rng, q, v, _, _ = states(rig, seed)
    twists = art.link_velocities(rig, q, v)
    for link in list(rig.links.values())[::3]:
        np.testing.assert_allclose(np.einsum("nij,nj->ni", art.jacobian(rig, q, link), v), twists[:, link.index], atol=1e-12)
        point = rng.normal(size=3)
        R = art.link_poses(rig, q)[:, link.index, :3, :3]
        moved = twists[:, link.index, :3] + np.cross(twists[:, link.index, 3:], R @ point)
        np.testing.assert_allclose(np.einsum("nij,nj->ni", art.jacobian(rig, q, link.name, point), v)[:, :3], moved, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_external_forces_act_through_jacobians(seed):
    rig = rig_of(seed)
    rng, q, v, a, tau = states(rig, seed)
    link, point, force, couple = list(rig.links)[-1], *rng.normal(size=(3, 3))
    external = art.point_wrench(rig, q, link, force, point, couple)
    J = art.jacobian(rig, q, link, point)
    through = np.einsum("nij,i->nj", J, np.concatenate([force, couple]))
    left = art.inverse_dynamics(rig, q, v, a) - art.inverse_dynamics(rig, q, v, a, external)
    np.testing.assert_allclose(left, through, atol=1e-11)
    expected = art.forward_dynamics(rig, q, v, tau + through)
    close(art.forward_dynamics(rig, q, v, tau, external), expected, rig, q)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocities_are_rates_of_poses(seed):
    rig = rig_of(seed)
    _, q, v, _, _ = states(rig, seed)
    h = 1e-5
    before, after = (art.link_poses(rig, art.integrate(rig, q, s * h * v)) for s in (-1, 1))
    rate = (after - before) / (2 * h)
    twists = art.link_velocities(rig, q, v)
    R = art.link_poses(rig, q)[..., :3, :3]
    spin = rate[..., :3, :3] @ np.swapaxes(R, -1, -2)
    np.testing.assert_allclose(rate[..., :3, 3], twists[..., :3], atol=1e-7)
    np.testing.assert_allclose(np.stack([spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]], -1), twists[..., 3:], atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_is_mass_times_the_centre_s_velocity(seed):
    rig = rig_of(seed)
    _, q, v, _, _ = states(rig, seed)
    h = 1e-5
    before, after = (art.center_of_mass(rig, art.integrate(rig, q, s * h * v)) for s in (-1, 1))
    np.testing.assert_allclose(art.momentum(rig, q, v)[:, :3], rig.mass * (after - before) / (2 * h), atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_gravity_forces_are_the_gradient_of_potential_energy(seed):
    rig = rig_of(seed)
    rng, q, v, _, _ = states(rig, seed)
    gravity, h = rng.normal(size=3), 1e-5
    before, after = (art.potential_energy(rig, art.integrate(rig, q, s * h * v), gravity) for s in (-1, 1))
    slope = (art.gravity_forces(rig, q, gravity) * v).sum(axis=-1)
    np.testing.assert_allclose((after - before) / (2 * h), slope, atol=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_kinetic_energy_is_half_v_M_v(seed):
    rig = rig_of(seed)
    _, q, v, _, _ = states(rig, seed)
    expected = 0.5 * np.einsum("ni,nij,nj->n", v, art.mass_matrix(rig, q), v)
    np.testing.assert_allclose(art.kinetic_energy(rig, q, v), expected, rtol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_difference_inverts_integrate(seed):
    rig = rig_of(seed)
    _, q, v, _, _ = states(rig, seed)
    v = v * (1.5 / np.abs(v).max())  # turns of less than π: no shorter way round
    np.testing.assert_allclose(art.difference(rig, q, art.integrate(rig, q, v)), v, atol=1e-12)
    for joint in rig.joints.values():
        if joint.kind in ("ball", "floating") and not joint.mimic:
            quat = art.integrate(rig, q, v)[:, joint.q_slice][:, -4:]
            np.testing.assert_allclose(np.linalg.norm(quat, axis=-1), 1.0, rtol=1e-15)


@pytest.mark.parametrize("seed", range(2000, 2012))
def test_where_the_root_is_makes_no_difference(seed):
    """A rig on a floating joint under the world moves as one whose root is free."""
    rig = random_rig(3 * (seed // 3) + 1)  # free
    text = rig.to_urdf().replace("</robot>", "")
    text += f'<link name="w"/><joint name="root_joint" type="floating"><parent link="w"/><child link="{next(iter(rig.links))}"/></joint></robot>'
    other = art.load(text)
    _, q, v, _, tau = states(rig, seed)
    expected = art.forward_dynamics(rig, q, v, tau)
    close(art.forward_dynamics(other, q, v, tau), expected, rig, q)


def test_a_universal_joint_is_two_hinges():
    builder = {kind: art.RigBuilder(kind) for kind in ("universal", "hinges")}
    for b in builder.values():
        b.link("base")
        b.link("arm", 1.0, (0.1, 0.2, -0.5), (0.1, 0.2, 0.15))
    axis, axis2 = (1.0, 0.3, 0.0), (0.0, 1.0, 0.2)
    builder["universal"].joint("u", "universal", "base", "arm", axis=axis, axis2=axis2)
    builder["hinges"].link("cross")
    builder["hinges"].joint("h1", "revolute", "base", "cross", axis=axis)
    builder["hinges"].joint("h2", "revolute", "cross", "arm", axis=axis2)
    one, two = (b.build() for b in builder.values())
    q, v, tau = np.random.default_rng(0).normal(size=(3, 50, 2))
    np.testing.assert_allclose(art.forward_dynamics(one, q, v, tau), art.forward_dynamics(two, q, v, tau), rtol=1e-9)


def test_a_follower_moves_as_a_constrained_joint():
    """Two hinges with followers: M of the reduced coordinates is Gᵀ M G of all of them."""
    rig = random_rig(2002, mimic=True, size=10)
    builder_text = rig.to_urdf()
    import re

    free = art.load(re.sub(r"<mimic [^>]*/>", "", builder_text), rig.root)
    followers = [joint for joint in rig.joints.values() if joint.mimic]
    assert followers
    q = rig.random(0)
    G, q_all = np.zeros((free.nv, rig.nv)), free.neutral()
    for name, joint in rig.joints.items():
        mimic = joint.mimic
        own = rig.joints[mimic.joint] if mimic else joint
        ratio, offset = (mimic.multiplier, mimic.offset) if mimic else (1.0, 0.0)
        G[free.joints[name].v_slice, own.v_slice] = ratio * np.eye(own.nv)
        q_all[free.joints[name].q_slice] = ratio * q[own.q_slice] + offset if mimic else q[own.q_slice]
    np.testing.assert_allclose(art.mass_matrix(rig, q), G.T @ art.mass_matrix(free, q_all) @ G, atol=1e-12)
