"""Integrals over closed meshes against trimesh, and what is made of meshes that bound no solid."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh
from solids import BOX, pose, random_pose, same, without

import articulated as art
from articulated.rig.moments import moments_within


def random_mesh(seed: int) -> trimesh.Trimesh:
    """Closed and of any shape: a ball, a ring or a box whose vertices are pushed about, or two of them apart; or a hull."""
    rng = np.random.default_rng(seed)
    make = [
        lambda: trimesh.creation.icosphere(2, 1.0),
        lambda: trimesh.creation.torus(1.0, 0.4, 12, 8),
        lambda: trimesh.creation.box((1.0, 2.0, 3.0)).subdivide(),
        lambda: trimesh.Trimesh(rng.normal(size=(30, 3))).convex_hull,
        lambda: trimesh.util.concatenate([random_mesh(seed + 1), random_mesh(seed + 2).apply_translation([9.0, 0.0, 0.0])]),
    ][seed % 5]
    mesh = make()
    if seed % 5 < 3:
        mesh.vertices += 0.08 * rng.normal(size=mesh.vertices.shape)
    return mesh.apply_transform(np.diag([*rng.uniform(0.1, 3.0, 3), 1.0])).apply_transform(random_pose(seed))


class TestMeshIntegrals:
    @pytest.mark.parametrize("seed", range(50))
    def test_against_trimesh(self, seed):
        mesh = random_mesh(seed)
        reference = trimesh.triangles.mass_properties(mesh.triangles - mesh.center_mass, density=1.0)
        got = moments_within(np.asarray(mesh.triangles))
        assert got.volume == pytest.approx(mesh.volume, rel=1e-10)
        np.testing.assert_allclose(got.center, mesh.center_mass, rtol=1e-10, atol=1e-10)
        size = np.trace(reference.inertia)
        np.testing.assert_allclose(got.inertia, reference.inertia, atol=1e-10 * size)
        public = art.mass_properties(mesh, 1.0, repair_mesh=None)  # vertices 1e-8 apart are one to this
        np.testing.assert_allclose(public.inertia, reference.inertia, atol=1e-10 * size)
        assert public.mass == pytest.approx(mesh.volume, rel=1e-10)

    def test_a_tetrahedron(self):
        """∫ x² = 1/60, ∫ x y = 1/120 over the corner of a unit cube, whose centre is at 1/4."""
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
        got = moments_within(corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]])
        assert got.volume == pytest.approx(1 / 6, rel=1e-15)
        np.testing.assert_allclose(got.center, 0.25, rtol=1e-15)
        about_origin = got.second + got.volume * np.outer(got.center, got.center)
        np.testing.assert_allclose(about_origin, np.eye(3) / 120 + 1 / 120, rtol=1e-14)

    def test_a_ball_of_triangles_converges_with_the_square_of_the_edge(self):
        exact = art.mass_properties(art.Sphere(0.3))
        errors = []
        for k in range(1, 6):
            fine = art.mass_properties(trimesh.creation.icosphere(k, 0.3))
            errors.append([exact.mass - fine.mass, exact.inertia[0, 0] - fine.inertia[0, 0]])
        orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
        np.testing.assert_allclose(orders[-2:], 2.0, atol=0.03)
        np.testing.assert_allclose(orders, 2.0, atol=0.2)


class TestRepairs:
    def box(self) -> trimesh.Trimesh:
        return trimesh.creation.box(BOX.size, pose(at=(1.0, 2.0, 3.0)))

    def inverted(self) -> trimesh.Trimesh:
        mesh = self.box()
        mesh.invert()
        return mesh

    def test_inside_out(self):
        """A dumbbell, so that its hull is another solid than itself."""
        dumbbell = trimesh.util.concatenate([self.box(), self.box().apply_translation([1.0, 0.0, 0.0])])
        expected = art.mass_properties(dumbbell)
        dumbbell.invert()
        with pytest.warns(art.RigWarning, match="is inside out; its triangles are turned round for the mass properties"):
            same(art.mass_properties(dumbbell, repair_mesh="flip"), expected)
        with pytest.warns(art.RigWarning, match="is inside out; its convex hull is used"):
            assert art.mass_properties(dumbbell).mass > 2 * expected.mass
        with pytest.raises(ValueError, match=r"12 triangles: this mesh is inside out: it bounds no solid; turn it .*'flip'"):
            art.mass_properties(self.inverted(), repair_mesh=None)

    @pytest.mark.parametrize("repair", ["flip", None])
    def test_what_is_refused(self, tmp_path, repair):
        twisted = self.box()
        twisted.faces[0] = twisted.faces[0][::-1]
        for mesh, fault in (
            (without(self.box(), 0), "is not closed: it has 3 open edges"),
            (twisted, "has triangles that do not all face outwards"),
            (trimesh.util.concatenate([self.box(), self.inverted()]), "encloses no volume"),
        ):
            with pytest.raises(ValueError, match=f"this mesh {fault}: it bounds no solid; correct the mesh, or .*'hull'"):
                art.mass_properties(mesh, repair_mesh=repair)
        without(self.box(), 0).export(tmp_path / "open.stl")
        with pytest.raises(ValueError, match=r"open\.stl: this mesh is not closed"):
            art.mass_properties(tmp_path / "open.stl", repair_mesh=repair)

    def test_partly_inside_out(self):
        """A box, and far from it a smaller one that counts negative: closed, of positive volume, and yet no solid."""
        small = self.inverted().apply_scale(0.9).apply_translation([5.0, 0.0, 0.0])
        mesh = trimesh.util.concatenate([self.box(), small])
        assert mesh.volume > 0.0
        fault = "has moments of inertia that violate the triangle inequality: some of it is inside out"
        with pytest.raises(ValueError, match=f"this mesh {fault}"):
            art.mass_properties(mesh, repair_mesh=None)
        with pytest.warns(art.RigWarning, match=f"{fault}; its convex hull is used"):
            art.mass_properties(mesh)

    def test_a_good_mesh_needs_none(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for repair in ("hull", "flip", None):
                same(
                    art.mass_properties(self.box(), repair_mesh=repair), art.mass_properties(art.Shape(BOX, pose(at=(1, 2, 3))))
                )

    @pytest.mark.parametrize("repair", ["none", True, 1])
    def test_no_such_repair(self, repair):
        with pytest.raises(ValueError, match=r"repair_mesh is .*; expected 'hull', 'flip' or None"):
            art.mass_properties(BOX, repair_mesh=repair)
