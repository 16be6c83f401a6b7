"""Spatial algebra against dense 6x6 matrices, and rotations against SciPy's, on floats and on arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from random_trees import random_inertia
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from articulated import scalar
from articulated.spatial import ArticulatedInertia, Force, Mat3, Motion, Pose, RigidInertia, Sym3, UnitMotion, Vec3
from articulated.spatial import rotation as rot

ANGLES = [0.0, 1e-9, 1e-5, 1e-3, 0.0099, 0.01, 0.0101, 0.1, 1.0, 3.0, math.pi - 1e-7, math.pi]


def skew(r) -> np.ndarray:
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def motion_matrix(X: Pose) -> np.ndarray:
    """B to A coordinates of motions, RBDA 2.24."""
    R = np.array([list(row) for row in X.R.rows])
    return np.block([[R, np.zeros((3, 3))], [skew(list(X.p)) @ R, R]])


def array(x) -> np.ndarray:
    return np.array([*x.angular, *x.linear])


def dense(I: ArticulatedInertia | RigidInertia) -> np.ndarray:
    if isinstance(I, RigidInertia):
        I = I.articulated()
    J, H, M = (np.array([list(row) for row in A.rows]) for A in (I.J.as_matrix(), I.H, I.M.as_matrix()))
    return np.block([[J, H], [H.T, M]])


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def random_pose(rng) -> Pose:
    return Pose(Mat3.of(Rotation.random(random_state=1).as_matrix().tolist()), Vec3.of(rng.normal(size=3).tolist()))


def random_motion(rng) -> Motion:
    return Motion(Vec3.of(rng.normal(size=3).tolist()), Vec3.of(rng.normal(size=3).tolist()))


def random_rigid(rng) -> RigidInertia:
    mass, c = 1.7, rng.normal(size=3)
    J = random_inertia(rng, mass) + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return RigidInertia(mass, Vec3.of((mass * c).tolist()), Sym3.of(J.tolist()))


def random_articulated(rng) -> ArticulatedInertia:
    A = rng.normal(size=(6, 6))
    A = A @ A.T
    return ArticulatedInertia(Sym3.of(A[:3, :3].tolist()), Mat3.of(A[:3, 3:].tolist()), Sym3.of(A[3:, 3:].tolist()))


class TestPose:
    def test_motions_and_forces(self, rng):
        X, v = random_pose(rng), random_motion(rng)
        f = Force(v.linear, v.angular)
        E = motion_matrix(X)
        np.testing.assert_allclose(array(X.motion_to_parent(v)), E @ array(v))
        np.testing.assert_allclose(array(X.motion_to_child(v)), np.linalg.solve(E, array(v)), atol=1e-14)
        np.testing.assert_allclose(array(X.force_to_parent(f)), np.linalg.solve(E.T, array(f)), atol=1e-14)
        np.testing.assert_allclose(array(X.force_to_child(f)), E.T @ array(f), atol=1e-14)

    def test_power_does_not_depend_on_the_frame(self, rng):
        X, v, f = random_pose(rng), random_motion(rng), Force(*[Vec3.of(rng.normal(size=3).tolist()) for _ in range(2)])
        assert X.motion_to_parent(v).dot(X.force_to_parent(f)) == pytest.approx(v.dot(f))

    def test_composition_and_inverse(self, rng):
        X, Y = random_pose(rng), random_pose(rng)
        np.testing.assert_allclose(motion_matrix(X @ Y), motion_matrix(X) @ motion_matrix(Y), atol=1e-14)
        np.testing.assert_allclose(motion_matrix(X @ X.inverse()), np.eye(6), atol=1e-14)

    def test_inertias(self, rng):
        X = random_pose(rng)
        E = np.linalg.inv(motion_matrix(X))
        for I, moved in ((random_rigid(rng), X.rigid_to_parent), (random_articulated(rng), X.articulated_to_parent)):
            np.testing.assert_allclose(dense(moved(I)), E.T @ dense(I) @ E, atol=1e-13)


class TestVectors:
    def test_products(self, rng):
        v, m = random_motion(rng), random_motion(rng)
        f = Force(m.angular, m.linear)
        w, u = list(v.angular), list(v.linear)
        cross = np.block([[skew(w), np.zeros((3, 3))], [skew(u), skew(w)]])
        np.testing.assert_allclose(array(v.cross(m)), cross @ array(m))
        np.testing.assert_allclose(array(v.cross_force(f)), -cross.T @ array(f))

    def test_inertia_times_motion(self, rng):
        v = random_motion(rng)
        for I in (random_rigid(rng), random_articulated(rng)):
            np.testing.assert_allclose(array(I @ v), dense(I) @ array(v))

    @pytest.mark.parametrize("k", range(6))
    def test_unit_motions_are_motions(self, rng, k):
        S, I, f = UnitMotion(k), random_articulated(rng), Force(*[Vec3.of(rng.normal(size=3).tolist()) for _ in range(2)])
        plain = Motion(S.angular, S.linear)
        assert array(S).tolist() == np.eye(6)[k].tolist()
        np.testing.assert_allclose(array(I @ S), array(I @ plain))
        np.testing.assert_allclose(array(S * 2.5), array(plain * 2.5))
        assert S.dot(f) == pytest.approx(plain.dot(f))

    @pytest.mark.parametrize("k", range(6))
    def test_elimination(self, rng, k):
        I, S = random_articulated(rng), UnitMotion(k)
        U = I @ S
        left = I.minus_outer(U, U * (1.0 / S.dot(U)))
        A = dense(I)
        expected = A - np.outer(A[k], A[k]) / A[k, k]
        np.testing.assert_allclose(dense(left), expected, atol=1e-12)
        np.testing.assert_allclose(dense(left.without(S)), expected, atol=1e-12)
        assert not dense(left.without(S))[k].any()


class TestRotations:
    @pytest.mark.parametrize("angle", ANGLES)
    def test_exp_and_log(self, rng, angle):
        axis = rng.normal(size=3)
        vector = angle * axis / np.linalg.norm(axis)
        quat = rot.quaternion_exp(Vec3.of(vector.tolist()))
        np.testing.assert_allclose(quat, Rotation.from_rotvec(vector).as_quat(), atol=1e-15)
        np.testing.assert_allclose(list(rot.quaternion_log(quat)), vector, rtol=1e-13, atol=1e-16)
        np.testing.assert_allclose(list(rot.quaternion_log([-x for x in quat])), vector, rtol=1e-13, atol=1e-16)

    @pytest.mark.parametrize("angle", ANGLES)
    def test_translation_of_a_screw(self, rng, angle):
        axis, v = rng.normal(size=(2, 3))
        w = angle * axis / np.linalg.norm(axis)
        twist = np.zeros((4, 4))
        twist[:3, :3], twist[:3, 3] = skew(w), v
        moved = rot.exp_translation(Vec3.of(w.tolist()), Vec3.of(v.tolist()))
        np.testing.assert_allclose(list(moved), expm(twist)[:3, 3], rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(list(rot.log_translation(Vec3.of(w.tolist()), moved)), v, rtol=1e-12, atol=1e-14)

    def test_matrices(self, rng):
        quat = Rotation.random(random_state=3).as_quat()
        as_array = np.array([list(row) for row in rot.rotation_of_quaternion(quat.tolist()).rows])
        np.testing.assert_allclose(as_array, Rotation.from_quat(quat).as_matrix(), atol=1e-15)
        axis = np.array([0.6, 0.0, 0.8])
        as_array = np.array([list(row) for row in rot.rotation_about(Vec3.of(axis.tolist()), 0.7).rows])
        np.testing.assert_allclose(as_array, Rotation.from_rotvec(0.7 * axis).as_matrix(), atol=1e-15)
        as_array = np.array([list(row) for row in rot.rotation_about_z(0.7).matrix().rows])
        np.testing.assert_allclose(as_array, Rotation.from_rotvec([0, 0, 0.7]).as_matrix(), atol=1e-15)

    def test_product(self):
        a, b = (Rotation.random(random_state=k) for k in (4, 5))
        product = np.array(rot.quaternion_product(a.as_quat().tolist(), b.as_quat().tolist()))
        expected = (a * b).as_quat()
        np.testing.assert_allclose(product * np.sign(product @ expected), expected, atol=1e-15)

    def test_arrays_give_what_floats_give(self, rng):
        vectors = np.concatenate([rng.normal(size=(20, 3)) * 10.0 ** rng.uniform(-8, 0, (20, 1)), np.zeros((1, 3))])
        together = np.stack(rot.quaternion_exp(Vec3.of(list(vectors.T))), axis=-1)
        alone = [rot.quaternion_exp(Vec3.of(vector.tolist())) for vector in vectors]
        np.testing.assert_allclose(together, alone, atol=1e-15)
        assert np.isfinite(together).all()


class TestScalar:
    @pytest.mark.parametrize("name", ["sin", "cos", "sqrt", "exp", "log", "absolute"])
    def test_floats_and_arrays(self, name):
        function = getattr(scalar, name)
        assert function(0.7) == pytest.approx(getattr(np, name)(0.7))
        assert isinstance(function(0.7), float)
        np.testing.assert_array_equal(function(np.array([0.5, 2.0])), getattr(np, name)([0.5, 2.0]))
        assert function(np.float32(0.7)).dtype == np.float32

    def test_outside_the_domain_is_nan(self):
        assert math.isnan(scalar.sqrt(-1.0))
        assert math.isnan(scalar.sin(math.inf))
        assert math.isnan(scalar.log(-1.0))

    def test_traced_operands_are_asked(self):
        class Traced:
            def sin(self):
                return "sin"

            def atan2(self, y, x):
                return "atan2"

            def where(self, a, b):
                return (a, b)

        assert scalar.sin(Traced()) == "sin"
        assert scalar.atan2(1.0, Traced()) == "atan2"
        assert scalar.where(Traced(), 1.0, 2.0) == (1.0, 2.0)

    def test_where_and_extremes(self):
        a, b = np.array([1.0, 5.0]), np.array([2.0, 3.0])
        assert scalar.where(True, 1.0, 2.0) == 1.0
        np.testing.assert_array_equal(scalar.where(a < b, a, b), [1.0, 3.0])
        np.testing.assert_array_equal(scalar.maximum(a, b), [2.0, 5.0])
        np.testing.assert_array_equal(scalar.minimum(a, b), [1.0, 3.0])
        assert scalar.atan2(1.0, 1.0) == math.atan2(1.0, 1.0)
