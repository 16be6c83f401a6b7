"""The boundary of the public functions: batches, types, and what is said of arguments that do not fit."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art

FUNCTIONS = {
    "forward_dynamics": ("q", "v", "tau"),
    "inverse_dynamics": ("q", "v", "a"),
    "bias_forces": ("q", "v"),
    "gravity_forces": ("q",),
    "mass_matrix": ("q",),
    "link_poses": ("q",),
    "link_velocities": ("q", "v"),
    "center_of_mass": ("q",),
    "momentum": ("q", "v"),
    "kinetic_energy": ("q", "v"),
    "potential_energy": ("q",),
    "integrate": ("q", "dv"),
    "difference": ("q0", "q1"),
    "passive_forces": ("v",),
}


@pytest.fixture(scope="module")
def rig() -> art.Rig:
    return art.load("ragdoll", "free")


def arguments(rig: art.Rig, name: str, batch=(), dtype=float) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    return [
        (rig.random(rng, batch) if what.startswith("q") else rng.normal(size=(*batch, rig.nv))).astype(dtype)
        for what in FUNCTIONS[name]
    ]


@pytest.mark.parametrize("name", FUNCTIONS)
class TestEvery:
    def test_batches_lead(self, rig, name):
        function = getattr(art, name)
        batch = arguments(rig, name, (2, 3))
        together = function(rig, *batch)
        assert together.shape[:2] == (2, 3)
        for i, j in np.ndindex(2, 3):
            np.testing.assert_allclose(together[i, j], function(rig, *(a[i, j] for a in batch)), rtol=1e-11, atol=1e-11)

    def test_leading_axes_broadcast(self, rig, name):
        function = getattr(art, name)
        batch = arguments(rig, name, (3,))
        single = [batch[0], *(a[1] for a in batch[1:])]
        repeated = [batch[0], *(np.broadcast_to(a[1], a.shape) for a in batch[1:])]
        np.testing.assert_array_equal(function(rig, *single), function(rig, *repeated))

    def test_float32(self, rig, name):
        function = getattr(art, name)
        double = arguments(rig, name, (4,))
        single = [a.astype(np.float32) for a in double]
        result = function(rig, *single)
        assert result.dtype == np.float32
        expected = function(rig, *double)
        np.testing.assert_allclose(result, expected, atol=2e-3 * np.abs(expected).max())
        assert function(rig, *(a[0] for a in single)).dtype == np.float32
        assert function(rig, single[0], *double[1:]).dtype == (np.float64 if len(double) > 1 else np.float32)

    def test_out(self, rig, name):
        function = getattr(art, name)
        batch = arguments(rig, name, (4,))
        expected = function(rig, *batch)
        wide = np.full((*expected.shape, 2), np.nan)
        out = wide[..., 0]  # not contiguous
        assert function(rig, *batch, out=out) is out
        np.testing.assert_array_equal(out, expected)
        with pytest.raises(ValueError, match=r"out is float64 \(1,\); expected an array of float64, shape \(4"):
            function(rig, *batch, out=np.empty(1))
        with pytest.raises(ValueError, match="out is float32"):
            function(rig, *batch, out=np.empty(expected.shape, np.float32))
        with pytest.raises(ValueError, match="out is list; expected an array"):
            function(rig, *batch, out=[])
        out.flags.writeable = False
        with pytest.raises(ValueError, match="out is read-only"):
            function(rig, *batch, out=out)

    def test_empty_batch(self, rig, name):
        assert getattr(art, name)(rig, *arguments(rig, name, (0,))).shape[0] == 0

    def test_inputs_stay_as_they_are(self, rig, name):
        batch = arguments(rig, name, (4,))
        copies = [a.copy() for a in batch]
        getattr(art, name)(rig, *batch)
        for a, copy in zip(batch, copies, strict=True):
            np.testing.assert_array_equal(a, copy)

    def test_wrong_shape(self, rig, name):
        batch = arguments(rig, name, (4,))
        what = FUNCTIONS[name][-1]
        width = batch[-1].shape[-1]
        expected = rf"^{what} has shape \(4, {width - 1}\); expected \(\.\.\., {width}\) for rig 'ragdoll'$"
        with pytest.raises(ValueError, match=expected):
            getattr(art, name)(rig, *batch[:-1], batch[-1][:, :-1])
        with pytest.raises(ValueError, match=rf"^{what} has shape \(\); expected"):
            getattr(art, name)(rig, *batch[:-1], 1.0)

    def test_nan(self, rig, name):
        batch = arguments(rig, name, (4,))
        batch[-1][2, 1] = np.nan
        with pytest.raises(
            ValueError, match=rf"^{FUNCTIONS[name][-1]}\[2, 1\] is nan \(root_joint\.v?y\); every entry must be"
        ):
            getattr(art, name)(rig, *batch)

    def test_not_numbers(self, rig, name):
        batch = arguments(rig, name)
        with pytest.raises(ValueError, match=r"holds .*; expected real numbers"):
            getattr(art, name)(rig, *batch[:-1], ["x"] * len(batch[-1]))
        with pytest.raises(ValueError, match=r"holds complex128; expected real numbers"):
            getattr(art, name)(rig, *batch[:-1], batch[-1] * 1j)
        with pytest.raises(ValueError, match=r"is not an array"):
            getattr(art, name)(rig, *batch[:-1], [[1.0], [1.0, 2.0]])

    def test_quaternion_that_is_not_of_unit_length(self, rig, name):
        if not FUNCTIONS[name][0].startswith("q"):
            pytest.skip("takes no configuration")
        batch = arguments(rig, name, (4,))
        batch[0][3, rig.joints["neck"].q_slice] *= 1.1
        expected = (
            rf"^{FUNCTIONS[name][0]}: the quaternion of joint 'neck' has norm 1\.1 in state \[3\]; expected 1, scalar last"
        )
        with pytest.raises(ValueError, match=expected):
            getattr(art, name)(rig, *batch)

    @pytest.mark.parametrize("threads", [0, -1, 1.5, "two"])
    def test_threads(self, rig, name, threads):
        with pytest.raises(ValueError, match=r"threads is .*; expected a positive integer or None"):
            getattr(art, name)(rig, *arguments(rig, name), threads=threads)

    def test_integers_are_numbers(self, rig, name):
        batch = arguments(rig, name)
        batch[-1] = rig.neutral() if FUNCTIONS[name][-1].startswith("q") else np.zeros(rig.nv)
        integers = [*batch[:-1], batch[-1].astype(int)]
        np.testing.assert_array_equal(getattr(art, name)(rig, *integers), getattr(art, name)(rig, *batch))


def test_batches_that_do_not_broadcast(rig):
    q, v, tau = arguments(rig, "forward_dynamics", (4,))
    expected = r"leading axes do not broadcast for rig 'ragdoll': q \(4, 43\), v \(3, 36\), tau \(4, 36\)"
    with pytest.raises(ValueError, match=expected):
        art.forward_dynamics(rig, q, v[:3], tau)


def test_gravity_may_differ_from_state_to_state(rig):
    q, v, tau = arguments(rig, "forward_dynamics", (2,))
    gravity = np.array([[0.0, 0.0, -9.81], [0.0, 0.0, -1.62]])
    together = art.forward_dynamics(rig, q, v, tau, gravity=gravity)
    np.testing.assert_allclose(together[1], art.forward_dynamics(rig, q[1], v[1], tau[1], gravity=gravity[1]), rtol=1e-9)
    with pytest.raises(ValueError, match=r"gravity has shape \(2,\); expected \(\.\.\., 3\)"):
        art.gravity_forces(rig, q, gravity=(0.0, 0.0))


def test_links_by_name_index_and_themselves(rig):
    q = rig.neutral()
    link = rig.links["left_foot"]
    expected = art.jacobian(rig, q, "left_foot")
    np.testing.assert_array_equal(art.jacobian(rig, q, link), expected)
    np.testing.assert_array_equal(art.jacobian(rig, q, link.index), expected)
    with pytest.raises(ValueError, match=r"rig 'ragdoll' has no link 'left_fot'; did you mean 'left_foot'"):
        art.jacobian(rig, q, "left_fot")
    with pytest.raises(ValueError, match=r"link index is 99; expected less than 15"):
        art.jacobian(rig, q, 99)
    with pytest.raises(ValueError, match=r"link 'left_foot' is of another rig"):
        art.jacobian(rig, q, art.load("ragdoll").links["left_foot"])


def test_wrong_external(rig):
    q, v, tau = arguments(rig, "forward_dynamics")
    with pytest.raises(ValueError, match=r"external has shape \(6,\); expected \(\.\.\., 15, 6\) for rig 'ragdoll'"):
        art.forward_dynamics(rig, q, v, tau, np.zeros(6))


def test_a_rig_that_does_not_move():
    rig = art.load('<robot name="rock"><link name="rock"/></robot>')
    assert art.forward_dynamics(rig, [], [], []).shape == (0,)
    assert art.mass_matrix(rig, np.empty((5, 0))).shape == (5, 0, 0)
    assert art.link_poses(rig, []).shape == (1, 4, 4)
    assert art.kinetic_energy(rig, [], []) == 0.0
    with pytest.raises(ValueError, match=r"nothing of rig 'rock' moves, so it has no centre of mass"):
        art.center_of_mass(rig, [])


def test_a_singular_configuration_is_told_of():
    """Three hinges in one point, the outer two on one axis: no mass resists their difference."""
    builder = art.RigBuilder("gimbal")
    for k in range(4):
        builder.link(f"l{k}", *((1.0, (0, 0, 0), (1, 1, 1)) if k == 3 else ()))
    for k, axis in enumerate([(0, 0, 1), (1, 0, 0), (0, 0, 1)], start=1):
        builder.joint(f"j{k}", "revolute", f"l{k - 1}", f"l{k}", axis=axis)
    rig = builder.build()
    fine, locked, zero = np.array([0.0, 1.0, 0.0]), np.zeros(3), np.zeros(3)
    assert np.isfinite(art.forward_dynamics(rig, fine, zero, zero)).all()
    with pytest.warns(RuntimeWarning, match=r"the result of rig 'gimbal' is not finite: .* mass matrix is singular; give"):
        art.forward_dynamics(rig, locked, zero, zero)
    with pytest.warns(RuntimeWarning, match=r"the result for state \[1\] of rig 'gimbal'") as caught:
        a = art.forward_dynamics(rig, np.stack([fine, locked, fine]), zero, zero)
    assert caught[0].filename == __file__
    assert np.isfinite(a[[0, 2]]).all()
    assert np.isfinite(art.forward_dynamics(rig.with_joints(armature=0.1), locked, zero, zero)).all()


def test_every_public_function_takes_out_and_threads():
    for name in [*FUNCTIONS, "jacobian", "point_wrench"]:
        parameters = inspect.signature(getattr(art, name)).parameters
        assert parameters["out"].default is None
        assert parameters["threads"].default is None


class TestPassive:
    def test_values(self):
        rig = random_rig(1, size=4).with_joints(damping=2.0, friction=0.5)
        v = np.full(rig.nv, 3.0)
        expected = -2.0 * 3.0 - 0.5 * 3.0 / np.hypot(3.0, 0.01)
        own = art.passive_forces(rig, v)[rig.damping > 0]
        assert own.size
        np.testing.assert_allclose(own, expected)

    def test_off_by_default_in_forward_dynamics(self):
        rig = art.load("pendulum")
        loose, stiff = rig.with_joints(damping=0.0), rig.with_joints(damping=5.0, friction=1.0)
        q, v, tau = rig.neutral(), np.ones(6), np.zeros(6)
        np.testing.assert_array_equal(art.forward_dynamics(stiff, q, v, tau), art.forward_dynamics(loose, q, v, tau))
        expected = art.forward_dynamics(loose, q, v, art.passive_forces(stiff, v))
        np.testing.assert_allclose(art.forward_dynamics(stiff, q, v, tau, joint_forces=True), expected, rtol=1e-12)
