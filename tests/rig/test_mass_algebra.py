"""Mass properties moved, turned, added and asked about other points, against Pinocchio and against the solids themselves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from solids import BOX, random_pose, same

import articulated as art


class TestMassProperties:
    """What is done with them: move, add, and ask about other points."""

    SHAPES = (art.Box((0.2, 0.3, 0.5)), art.Cone(0.3, 0.8), art.Hollow(art.Capsule(0.1, 0.3), 0.02))

    @pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
    def test_turning_and_moving_commute_with_the_computation(self, shape):
        for seed in range(20):
            X, Y = random_pose(seed), random_pose(100 + seed)
            here = art.mass_properties(shape, 700.0)
            same(here.moved(X), art.mass_properties(art.Shape(shape, X), 700.0), 1e-13)
            same(here.moved(X).moved(Y), here.moved(Y @ X), 1e-13)
            same(here.moved(X).moved(np.linalg.inv(X)), here, 1e-12)
            np.testing.assert_allclose(here.moved(X).principal_moments, here.principal_moments, rtol=1e-12)

    def test_meshes_too(self):
        mesh = trimesh.creation.annulus(0.1, 0.3, 0.2)
        for seed in range(20):
            X = random_pose(seed)
            same(art.mass_properties(mesh.copy().apply_transform(X)), art.mass_properties(mesh).moved(X), 1e-7)

    def test_against_pinocchio(self):
        a, b = (art.mass_properties(shape, 300.0).moved(random_pose(k)) for k, shape in enumerate(self.SHAPES[:2]))
        both = pin.Inertia(a.mass, a.center, a.inertia) + pin.Inertia(b.mass, b.center, b.inertia)
        for got in (a + b, b + a, art.MassProperties.combined([a, b]), art.MassProperties.combined(iter([b, a]))):
            assert got.mass == pytest.approx(both.mass, rel=1e-14)
            np.testing.assert_allclose(got.center, both.lever, rtol=1e-13)
            np.testing.assert_allclose(got.inertia, both.inertia, rtol=1e-12)
        X = random_pose(7)
        moved = pin.SE3(X[:3, :3], X[:3, 3]).act(both)
        np.testing.assert_allclose((a + b).moved(X).inertia, moved.inertia, rtol=1e-12)
        # the lower right block of a spatial inertia is about the origin
        np.testing.assert_allclose(a.about((0, 0, 0)), pin.Inertia(a.mass, a.center, a.inertia).matrix()[3:, 3:], rtol=1e-12)

    def test_about_another_point(self):
        rod = art.mass_properties(art.Box((1e-6, 1e-6, 3.0)), mass=2.0)
        assert rod.about((0.0, 0.0, 1.5))[0, 0] == pytest.approx(2.0 * 9.0 / 3.0)
        np.testing.assert_array_equal(rod.about(rod.center), rod.inertia)

    def test_the_same_as_one_solid(self):
        parts = [art.Shape(shape, random_pose(k)) for k, shape in enumerate(self.SHAPES)]
        same(art.MassProperties.combined([art.mass_properties(part) for part in parts]), art.mass_properties(parts), 1e-12)

    def test_refused(self):
        one = np.eye(3)
        for arguments, message in (
            ((0.0, (0, 0, 0), one), r"mass is 0\.0; expected a positive number of kilograms"),
            ((1.0, (0, 0), one), r"center has shape \(2,\); expected \(3,\)"),
            ((1.0, (0, 0, 0), [1, 1, 1]), r"inertia has shape \(3,\); expected \(3, 3\)"),
            ((1.0, (0, np.nan, 0), one), r"center is not finite"),
            ((1.0, (0, 0, 0), [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]), "inertia is not symmetric"),
            ((1.0, (0, 0, 0), np.diag([1.0, 1.0, 2.5])), r"inertia violates the triangle inequality by 20 %: no body has"),
            ((1.0, (0, 0, 0), -one), "inertia violates the triangle inequality"),
        ):
            with pytest.raises(ValueError, match=message):
                art.MassProperties(*arguments)
        solid = art.mass_properties(BOX)
        with pytest.raises(ValueError, match="pose is not a rotation and a translation"):
            solid.moved(2.0 * np.eye(4))
        with pytest.raises(ValueError, match=r"point has shape \(2,\)"):
            solid.about((0.0, 0.0))
        with pytest.raises(ValueError, match="an empty sequence of mass properties was given"):
            art.MassProperties.combined([])
