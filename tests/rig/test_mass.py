"""Mass properties: closed forms against quadrature, meshes against boxes, sums against wholes; and what is refused."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from solids import BOX, pose, same, without

import articulated as art


def soup(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same triangles, no two of which share a vertex, as in an STL."""
    return trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False)


class TestPlainShapes:
    @pytest.mark.parametrize(
        ("shape", "end", "kinks", "profile"),
        [
            (art.Sphere(0.3), 0.3, [], lambda z: np.sqrt(0.09 - z * z)),
            (art.Cylinder(0.3, 0.8), 0.4, [], lambda z: 0.3),
            (art.Capsule(0.3, 0.8), 0.7, [0.4], lambda z: 0.3 if z < 0.4 else np.sqrt(max(0.09 - (z - 0.4) ** 2, 0.0))),
            (art.Capsule(0.3, 0.0), 0.3, [], lambda z: np.sqrt(0.09 - z * z)),
        ],
    )
    def test_solids_of_revolution(self, shape, end, kinks, profile):
        """Slice by slice: a disc of radius r weighs π r² dz and has the moment π r⁴/4 dz about its diameters."""

        def integral(slice_):
            return 2.0 * quad(slice_, 0.0, end, points=kinks or None, epsabs=1e-13)[0]

        discs = integral(lambda z: np.pi * profile(z) ** 4 / 4)
        height = integral(lambda z: np.pi * profile(z) ** 2 * z * z)
        got = art.mass_properties(shape, 1.0)
        assert got.mass == pytest.approx(integral(lambda z: np.pi * profile(z) ** 2), rel=1e-9)
        np.testing.assert_allclose(got.inertia, np.diag([discs + height, discs + height, 2 * discs]), rtol=1e-8)
        np.testing.assert_array_equal(got.center, 0.0)

    def test_box(self):
        got = art.mass_properties(art.Box((0.2, 0.3, 0.5)), 100.0)
        assert got.mass == pytest.approx(3.0)
        np.testing.assert_allclose(got.inertia, np.diag([0.34, 0.29, 0.13]) * 3.0 / 12.0)

    @pytest.mark.parametrize(
        ("shape", "mesh"),
        [
            (art.Sphere(0.3), trimesh.creation.icosphere(4, 0.3)),
            (art.Cylinder(0.3, 0.8), trimesh.creation.cylinder(0.3, 0.8, sections=200)),
            (art.Capsule(0.3, 0.8), trimesh.creation.capsule(0.8, 0.3, count=[100, 100])),
        ],
    )
    def test_a_fine_mesh_of_a_shape_is_nearly_that_shape(self, shape, mesh):
        got, fine = art.mass_properties(shape), art.mass_properties(mesh)
        same(got, fine, 6e-3)
        assert fine.mass < got.mass  # it is inscribed

    def test_mass_instead_of_density(self):
        one = art.mass_properties(BOX, 250.0)
        same(art.mass_properties(BOX, mass=one.mass), one)
        same(art.mass_properties(BOX, 17.0, mass=one.mass), one)
        assert art.mass_properties(BOX).mass == pytest.approx(30.0)

    def test_frozen(self):
        got = art.mass_properties(art.Shape(BOX))
        for array in (got.center, got.inertia):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0


class TestSums:
    def test_poses_count(self):
        """Points drawn from the shape, moved by the pose."""
        X = pose((1, 2, 3), (0.4, -0.5, 0.6))
        points = (np.random.default_rng(0).uniform(-0.5, 0.5, (100_000, 3)) * BOX.size) @ X[:3, :3].T + X[:3, 3]
        got = art.mass_properties(art.Shape(BOX, X), mass=2.0)
        covariance = np.cov(points.T)
        np.testing.assert_allclose(got.center, points.mean(axis=0), atol=3e-3)
        np.testing.assert_allclose(got.inertia, 2.0 * (np.trace(covariance) * np.eye(3) - covariance), atol=3e-4)

    def test_pieces_make_the_whole(self):
        X = pose((-1, 1, 2), (1.0, 2.0, 3.0))
        quarter = np.array(BOX.size) / 4.0
        pieces = [
            art.Shape(art.Box(tuple(2 * quarter)), X @ pose(at=quarter * signs))
            for signs in itertools.product((-1, 1), repeat=3)
        ]
        same(art.mass_properties(pieces), art.mass_properties(art.Shape(BOX, X)))
        same(art.mass_properties(tuple(pieces), mass=3.0), art.mass_properties(art.Shape(BOX, X), mass=3.0))

    def test_a_capsule_is_a_cylinder_and_two_half_balls(self):
        ball = trimesh.creation.icosphere(5, 0.3)
        half = trimesh.convex.convex_hull(ball.vertices[ball.vertices[:, 2] > -1e-9])
        caps = [half.copy().apply_transform(X) for X in (pose(at=(0, 0, 0.4)), pose((0, 0, -1), (0, 0, -0.4)))]
        same(art.mass_properties([art.Cylinder(0.3, 0.8), *caps]), art.mass_properties(art.Capsule(0.3, 0.8)), 2e-3)

    @settings(max_examples=50, deadline=None)
    @given(st.lists(st.floats(0.01, 10.0), min_size=6, max_size=6), st.sampled_from([1e-3, 1.0, 1e3]))
    def test_builders_accept_them(self, x, density):
        at = pose(x[:3], x[3:6])
        solid = art.mass_properties([art.Capsule(x[0], x[1]), art.Shape(art.Cylinder(x[2], x[3]), at)], density)
        builder = art.RigBuilder()
        builder.link("body", solid.mass, solid.center, solid.inertia)
        assert builder.build("free").mass == solid.mass


class TestMeshes:
    def box(self, at=(0.0, 0.0, 0.0)) -> trimesh.Trimesh:
        return trimesh.creation.box(BOX.size, pose(at=at))

    @pytest.mark.parametrize("ending", ["stl", "obj", "ply", "glb", "dae"])
    def test_files(self, tmp_path, ending):
        path = tmp_path / f"box.{ending}"
        self.box((1.0, 2.0, 3.0)).export(path)
        expected = art.mass_properties(art.Shape(BOX, pose(at=(1.0, 2.0, 3.0))))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for given_ in (path, str(path), art.Mesh("box", path=path), art.Shape(art.Mesh("box", path=path))):
                same(art.mass_properties(given_), expected, 1e-6)

    @pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (0.001, 0.002, 0.003), (-1.0, 2.0, 3.0), (-1.0, -1.0, -1.0)])
    def test_scale_counts_and_the_pose_after_it(self, tmp_path, scale):
        path = tmp_path / "box.ply"
        self.box((1.0, 2.0, 3.0)).export(path)
        X = pose((1, 1, 1), (4, 5, 6))
        size, at = np.abs(scale) * BOX.size, np.array(scale) * (1.0, 2.0, 3.0)
        got = art.mass_properties(art.Shape(art.Mesh("box", scale, path), X))
        same(got, art.mass_properties(art.Shape(art.Box(tuple(size)), X @ pose(at=at))), 1e-6)

    def test_as_trimesh_has_it(self):
        mesh = trimesh.creation.annulus(0.1, 0.3, 0.2).apply_transform(pose((1, 2, 3), (0.3, 0.2, 0.1)))
        got = art.mass_properties(mesh, 500.0)
        assert got.mass == pytest.approx(500.0 * mesh.volume)
        np.testing.assert_allclose(got.center, mesh.center_mass, atol=1e-12)
        np.testing.assert_allclose(got.inertia, 500.0 * mesh.moment_inertia, atol=1e-10)

    def test_far_from_the_origin(self):
        at = (1e6, 2e6, -1e6)
        same(art.mass_properties(self.box(at)), art.mass_properties(art.Shape(BOX, pose(at=at))), 1e-7)

    @pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3])
    def test_of_any_size(self, size):
        mesh = trimesh.creation.box(np.array(BOX.size) * size)
        same(art.mass_properties(mesh), art.mass_properties(art.Box(tuple(np.array(BOX.size) * size))), 1e-10)

    def test_closed_all_the_same(self):
        """Vertices not shared; a triangle without area; boxes that touch in a face, in an edge, and not at all; a hole inside."""
        inner = trimesh.creation.box(np.array(BOX.size) / 2)
        inner.invert()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            same(art.mass_properties(soup(self.box())), art.mass_properties(BOX))
            sliver = trimesh.Trimesh(self.box().vertices, [*self.box().faces, (0, 1, 1)], process=False)
            same(art.mass_properties(sliver), art.mass_properties(BOX))
            for at in ((0.2, 0.0, 0.0), (0.2, 0.3, 0.0), (1.0, 0.0, 0.0)):
                both = trimesh.util.concatenate([self.box(), self.box(at)])
                same(art.mass_properties(both), art.mass_properties([BOX, art.Shape(BOX, pose(at=at))]))
            hollow = art.mass_properties(trimesh.util.concatenate([self.box(), inner]))
        assert hollow.mass == pytest.approx(30.0 * 7 / 8)
        np.testing.assert_allclose(hollow.inertia, art.mass_properties(BOX).inertia * 31 / 32, atol=1e-12)

    def test_what_bounds_no_solid_counts_as_its_hull(self, tmp_path):
        inverted, twisted = self.box(), self.box()
        inverted.invert()
        twisted.faces[0] = twisted.faces[0][::-1]
        for mesh, fault in (
            (without(self.box(), 0), "is not closed: it has 3 open edges"),
            (soup(without(self.box(), 0, 1)), "is not closed: it has"),
            (inverted, "is inside out"),
            (twisted, "has triangles that do not all face outwards"),
            (trimesh.util.concatenate([self.box(), inverted]), "encloses no volume"),
        ):
            with pytest.warns(art.RigWarning, match=f"{fault}.*; its convex hull is used"):
                got = art.mass_properties(mesh)
            same(got, art.mass_properties(BOX))
        path = tmp_path / "open.stl"
        without(self.box(), 0).export(path)
        with pytest.warns(art.RigWarning, match=r"open\.stl: is not closed"):
            got = art.mass_properties(art.Mesh("open", (2.0, 2.0, 2.0), path), mass=1.0)
        same(got, art.mass_properties(art.Box((0.4, 0.6, 1.0)), mass=1.0), 1e-6)

    def test_a_mesh_given_is_left_alone(self):
        mesh = soup(self.box((1.0, 0.0, 0.0)))
        before = mesh.vertices.copy(), mesh.faces.copy()
        art.mass_properties(mesh)
        np.testing.assert_array_equal(mesh.vertices, before[0])
        np.testing.assert_array_equal(mesh.faces, before[1])

    def test_units_that_are_not_metres(self, tmp_path):
        path = tmp_path / "box.dae"
        self.box().export(path)
        path.write_text(path.read_text().replace("<up_axis>", '<unit name="centimeter" meter="0.01"/><up_axis>', 1))
        with pytest.warns(art.RigWarning, match=r"box\.dae: says that its unit is 0\.01 \* meters, which is not applied"):
            art.mass_properties(path)
        with pytest.warns(art.RigWarning, match=r"is 500 m large; units are metres; were these millimetres"):
            art.mass_properties(trimesh.creation.box(np.array(BOX.size) * 1000))
        self.box().apply_scale(1000).export(tmp_path / "box.stl")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            art.mass_properties(art.Mesh("box", (1e-3, 1e-3, 1e-3), tmp_path / "box.stl"))
        with pytest.warns(art.RigWarning, match=r"box is 100 m large; units are metres"):
            art.mass_properties(art.Box((1.0, 1.0, 100.0)))


class TestErrors:
    @pytest.mark.parametrize("density", [0.0, -1.0, np.nan, np.inf, "heavy", None])
    def test_density(self, density):
        with pytest.raises(ValueError, match=r"density is .*; expected a positive number of kilograms a cubic metre"):
            art.mass_properties(BOX, density)

    @pytest.mark.parametrize("mass", [0.0, -1.0, np.nan, np.inf, "heavy"])
    def test_mass(self, mass):
        with pytest.raises(ValueError, match=r"mass is .*; expected a positive number of kilograms"):
            art.mass_properties(BOX, mass=mass)

    @pytest.mark.parametrize(
        ("given_", "message"),
        [
            (art.Sphere(-1.0), r"mass_properties: sphere has size \(-1\.0,\); give positive lengths in metres"),
            (art.Box((1.0, np.nan, 1.0)), r"box has size \(1\.0, nan, 1\.0\); give finite numbers"),
            (art.Box((1.0, 1.0)), r"box has size \(1\.0, 1\.0\); give 3 numbers"),
            (art.Cylinder("1", 1.0), r"cylinder has size \('1', 1\.0\); give 2 numbers"),
            (art.Sphere(None), r"sphere has size \(None,\); give 1 number$"),
            (art.Capsule(0.0, 1.0), r"Capsule\(radius=0\.0, length=1\.0\) has no volume; .* lengths of more than zero"),
            (art.Sphere(1e-40), r"Sphere\(radius=1e-40\) has no volume"),
            (art.Mesh("lost.stl"), r"mesh 'lost\.stl' was not found; give load its mesh_dirs, or the Mesh a path"),
            (art.Mesh("x", (1.0, 0.0, 1.0)), r"mesh scale is \(1\.0, 0\.0, 1\.0\); give numbers other than zero"),
            (art.Shape(BOX, 2.0 * np.eye(4)), r"pose of a Box is not a rotation and a translation; expected shape \(4, 4\)"),
            (art.Shape(BOX, np.eye(3)), r"pose of a Box is not a rotation"),
            (art.Shape(BOX, np.full((4, 4), np.nan)), r"pose of its box is not finite"),
            (art.Shape("box"), r"a geometry is 'box'; give a Sphere, Box, Cylinder, Capsule or Mesh"),
            (3, r"a geometry is 3; expected a Sphere, Box, Cylinder, Capsule or Mesh, a Shape, or the path of a mesh"),
            ([BOX, None], r"a geometry is None; expected"),
            ([], r"an empty sequence of shapes was given; expected one shape at least"),
            ("nowhere.stl", r"nowhere\.stl: no such file; give the path of a mesh"),
        ],
    )
    def test_shapes(self, given_, message):
        with pytest.raises(ValueError, match=message):
            art.mass_properties(given_)

    @pytest.mark.parametrize(
        ("vertices", "faces", "message"),
        [
            ([], [], r"Trimesh of 0 triangles: this mesh has no triangles; mass properties need a solid: give a closed mesh"),
            (
                [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
                [[0, 1, 2]],
                r"this mesh is flat; .* give a closed mesh, or a thin Box instead",
            ),
            ([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]], [[0, 1, 2], [1, 3, 2]], "this mesh is flat"),
            ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-7]], [[0, 1, 2], [1, 3, 2]], "this mesh is flat"),
            ([[1, 1, 1]] * 4, [[0, 1, 2], [1, 3, 2]], "this mesh is flat"),
            (
                [[0, 0, 0], [1, 0, 0], [0, np.nan, 0]],
                [[0, 1, 2]],
                "this mesh has vertices that are not finite; every one must be",
            ),
        ],
    )
    def test_meshes(self, vertices, faces, message):
        mesh = trimesh.Trimesh(np.array(vertices, dtype=float).reshape(-1, 3), np.array(faces).reshape(-1, 3), process=False)
        with pytest.raises(ValueError, match=message):
            art.mass_properties(mesh)

    def test_files(self, tmp_path):
        for name, text, message in (
            ("noise.stl", "solid noise", "noise.stl: this mesh"),
            ("mesh.xyzzy", "?", r"mesh\.xyzzy: this mesh cannot be read \(.*\); convert it to STL, OBJ or PLY"),
            ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", r"points\.obj: this mesh cannot be read \(it has no triangles\)"),
        ):
            (tmp_path / name).write_text(text)
            with pytest.raises(ValueError, match=message):
                art.mass_properties(tmp_path / name)
        with pytest.raises(ValueError, match=r"gone\.stl: no such file; give the path of a mesh"):
            art.mass_properties(art.Mesh("gone.stl", path=tmp_path / "gone.stl"))


class TestSolids:
    def test_against_pinocchio(self):
        for shape, reference in (
            (art.Sphere(0.3), pin.Inertia.FromSphere(2.0, 0.3)),
            (art.Box((0.2, 0.3, 0.5)), pin.Inertia.FromBox(2.0, 0.2, 0.3, 0.5)),
            (art.Cylinder(0.3, 0.8), pin.Inertia.FromCylinder(2.0, 0.3, 0.8)),
            (art.Capsule(0.3, 0.8), pin.Inertia.FromCapsule(2.0, 0.3, 0.8)),
            (art.Ellipsoid((0.2, 0.3, 0.5)), pin.Inertia.FromEllipsoid(2.0, 0.2, 0.3, 0.5)),
        ):
            got = art.mass_properties(shape, mass=2.0)
            np.testing.assert_allclose(got.inertia, reference.inertia, rtol=1e-13, atol=1e-16, err_msg=str(shape))
            np.testing.assert_array_equal(got.center, reference.lever)

    def test_volumes(self):
        for shape, volume in (
            (art.Sphere(0.3), 4 / 3 * np.pi * 0.027),
            (art.Cone(0.3, 0.8), np.pi * 0.09 * 0.8 / 3),
            (art.Ellipsoid((0.2, 0.3, 0.5)), 4 / 3 * np.pi * 0.03),
            (art.Capsule(0.3, 0.8), np.pi * 0.09 * 1.2),
        ):
            assert art.mass_properties(shape, 1.0).mass == pytest.approx(volume, rel=1e-13)

    def test_cone(self):
        """Its apex is up, its centre a quarter of its height above its base; 3/10 m r², 3/20 m r² + 3/80 m h²."""
        got = art.mass_properties(art.Cone(0.3, 0.8), mass=2.0)
        across = 2.0 * (3 / 20 * 0.09 + 3 / 80 * 0.64)
        np.testing.assert_allclose(got.center, [0.0, 0.0, -0.4 + 0.2], rtol=1e-13)
        np.testing.assert_allclose(got.inertia, np.diag([across, across, 2.0 * 0.3 * 0.09]), rtol=1e-13)
        mesh = trimesh.creation.cone(0.3, 0.8, sections=400).apply_translation([0.0, 0.0, -0.4])
        same(got, art.mass_properties(mesh, mass=2.0), 1e-3)

    def test_a_cone_is_cut_into_a_cone_and_slices(self):
        """Its upper half is a cone of half the size; the rest, by Simpson's rule, which is exact for r² of z."""
        whole, top = art.mass_properties(art.Cone(0.4, 1.0), 1.0), art.mass_properties(art.Cone(0.2, 0.5), 1.0)
        below = whole.mass - top.mass
        assert below == pytest.approx(np.pi * 0.5 / 6 * (0.2**2 + 4 * 0.3**2 + 0.4**2), rel=1e-13)

    @pytest.mark.parametrize("kind", ["Cone", "Ellipsoid", "Hollow"])
    def test_no_link_can_have_it(self, kind):
        solid = {"Cone": art.Cone(0.1, 0.2), "Ellipsoid": art.Ellipsoid((0.1, 0.2, 0.3)), "Hollow": art.Hollow(BOX)}[kind]
        instead = {"Cone": "a Cylinder, or the path of a mesh", "Ellipsoid": "a Sphere or a Capsule", "Hollow": "its Box"}[kind]
        message = rf"link 'a': a {kind} can be weighed, but it is no shape of a link; give {instead}.* from mass_properties"
        for shapes in ({"collisions": [solid]}, {"visuals": [art.Shape(solid)]}):
            with pytest.raises(art.RigError, match=message):
                art.RigBuilder().link("a", 1.0, inertia=(1.0, 1.0, 1.0), **shapes)
        with pytest.raises(ValueError, match=rf"a {kind} can be weighed|Cone"):
            art.loose_body(art.Hollow(art.Cone(0.1, 0.2), 0.01) if kind == "Hollow" else solid)
