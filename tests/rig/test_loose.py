"""Rigs of one body, alone and among others."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import articulated as art

CRATE = art.Box((0.4, 0.4, 0.4))


def at(x, y, z) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


class TestOneBody:
    def test_has_the_shape_and_its_mass_properties(self):
        shape = art.Shape(art.Cylinder(0.1, 0.5), at(0.1, 0.2, 0.3), color=(1.0, 0.0, 0.0, 1.0))
        rig, solid = art.loose_body(shape, density=700.0), art.mass_properties(shape, 700.0)
        (link,) = rig.links.values()
        assert (rig.name, link.name, rig.root, rig.nq, rig.nv) == ("cylinder", "body", "free", 7, 6)
        assert link.collisions == link.visuals == (shape,)
        assert rig.mass == link.mass == solid.mass
        np.testing.assert_array_equal(link.center, solid.center)
        np.testing.assert_array_equal(link.inertia, solid.inertia)

    def test_mass_density_and_name(self):
        assert art.loose_body(CRATE).mass == pytest.approx(64.0)
        assert art.loose_body(CRATE, 8.0).mass == 8.0
        assert art.loose_body(CRATE, density=125.0).mass == pytest.approx(8.0)
        assert art.loose_body(CRATE, name="crate").name == "crate"

    @pytest.mark.parametrize(
        ("geometry", "name"),
        [(art.Sphere(1.0), "sphere"), (CRATE, "box"), (art.Capsule(1.0, 1.0), "capsule"), ([CRATE] * 2, "body")],
    )
    def test_is_called_by_its_geometry(self, geometry, name):
        assert art.loose_body(geometry).name == name

    def test_several_shapes(self):
        dumbbell = [art.Shape(art.Sphere(0.1), at(x, 0.0, 0.0)) for x in (-0.5, 0.5)]
        rig = art.loose_body(dumbbell, mass=10.0)
        assert len(rig.links["body"].collisions) == 2
        ball = 0.4 * 5.0 * 0.01
        np.testing.assert_allclose(rig.links["body"].inertia, np.diag([2 * ball, 2 * ball + 2.5, 2 * ball + 2.5]))
        assert art.loose_body(dumbbell).mass == pytest.approx(2 * art.loose_body(art.Sphere(0.1)).mass)

    def test_a_mesh_file_by_any_path(self, tmp_path, monkeypatch):
        trimesh.creation.box(CRATE.size).export(tmp_path / "crate.stl")
        monkeypatch.chdir(tmp_path)
        for path in ("crate.stl", tmp_path / "crate.stl"):
            rig = art.loose_body(path, mass=8.0)
            assert (rig.name, rig.mass) == ("mesh", 8.0)
            again = art.load(rig.to_urdf(), "free")  # finds the file wherever it is read
            monkeypatch.chdir("/")
            mesh = again.links["body"].collisions[0].geometry
            assert mesh.path == tmp_path / "crate.stl"
            assert mesh == rig.links["body"].visuals[0].geometry
            monkeypatch.chdir(tmp_path)

    def test_falls_and_spins_as_a_body_does(self):
        rig = art.loose_body(art.Shape(CRATE, at(0.3, 0.0, 0.0)), mass=8.0)
        wrench = np.array([[0.0, 0.0, 8.0 * 9.81, 0.0, 0.0, 0.0]])  # its weight, at the link's origin, not at its centre
        a = art.forward_dynamics(rig, rig.neutral(), np.zeros(6), np.zeros(6), external=wrench)
        alpha = 8.0 * 9.81 * 0.3 / (8.0 * 0.4**2 / 6.0)
        np.testing.assert_allclose(a, [0.0, 0.0, alpha * 0.3, 0.0, alpha, 0.0], atol=1e-12)

    def test_planar(self):
        assert art.loose_body(CRATE, root="planar").nv == 3


class TestScenery:
    @pytest.mark.parametrize("mass", [None, 0.0, 8.0])
    def test_does_not_move_and_has_no_mass(self, mass):
        rig = art.loose_body(CRATE, mass, root="fixed")
        assert (rig.nv, rig.mass, rig.links["body"].mass) == (0, 0.0, 0.0)
        assert rig.links["body"].collisions[0].geometry == CRATE

    def test_needs_no_solid(self, tmp_path):
        trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).export(tmp_path / "floor.stl")
        rig = art.loose_body(tmp_path / "floor.stl", root="fixed")
        assert rig.links["body"].collisions[0].geometry.path == tmp_path / "floor.stl"
        with pytest.raises(ValueError, match="this mesh is flat"):
            art.loose_body(tmp_path / "floor.stl")


class TestCompose:
    def test_with_a_robot(self):
        robot = art.load("ragdoll", root="free")
        ball, crate = art.loose_body(art.Sphere(0.1), mass=0.4), art.loose_body(CRATE, mass=8.0)
        scene = art.compose(robot, ball=ball, crate=crate, step=art.loose_body(art.Box((1.0, 1.0, 0.2)), root="fixed"))
        assert scene.nq == robot.nq + 14
        assert scene.mass == pytest.approx(robot.mass + 8.4)
        assert scene.links["ball/body"].collisions[0].geometry == art.Sphere(0.1)
        assert scene.links["step/body"].body == -1
        assert scene.joints["ball/root_joint"].q_slice == slice(robot.nq, robot.nq + 7)
        assert scene.joints["crate/root_joint"].v_slice == slice(robot.nv + 6, robot.nv + 12)
        q = scene.neutral()
        q[scene.joints["crate/root_joint"].q_slice] = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]
        np.testing.assert_array_equal(art.link_poses(scene, q)[scene.links["crate/body"].index], at(1.0, 2.0, 3.0))

    def test_each_moves_alone(self):
        one, other = art.loose_body(art.Capsule(0.1, 0.3), mass=1.0), art.loose_body(CRATE, mass=8.0)
        both, rng = art.compose(one, other), np.random.default_rng(0)
        parts = [(rig.random(rng), rng.normal(size=6), rng.normal(size=6)) for rig in (one, other)]
        expected = np.concatenate([art.forward_dynamics(rig, *x) for rig, x in zip((one, other), parts, strict=True)])
        got = art.forward_dynamics(both, *(np.concatenate(x) for x in zip(*parts, strict=True)))
        np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12)
        assert list(both.joints) == ["capsule/root_joint", "box/root_joint"]


class TestErrors:
    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ((CRATE, 0.0), r"mass is 0; expected a positive number of kilograms for what moves: give one, or root='fixed'"),
            ((CRATE, -1.0), r"mass is -1\.0; expected a positive number of kilograms"),
            ((CRATE, None, 0.0), r"density is 0\.0; expected a positive number"),
            ((art.Sphere(-1.0),), r"sphere has size \(-1\.0,\); give positive lengths in metres"),
            (([],), "expected one shape at least"),
            (("crate",), r"crate: no such file; give the path of a mesh"),
            ((trimesh.creation.box(),), "a Trimesh has no file that a rig could name; export it to one and give its path"),
            (([CRATE, trimesh.creation.box()],), "a Trimesh has no file"),
        ],
    )
    def test_arguments(self, arguments, message):
        with pytest.raises(ValueError, match=message):
            art.loose_body(*arguments)

    def test_root_and_what_scenery_cannot_be(self):
        with pytest.raises(ValueError, match="root is 'loose'; expected 'fixed', 'free' or 'planar'"):
            art.loose_body(CRATE, root="loose")
        with pytest.raises(ValueError, match="crate: no such file"):
            art.loose_body("crate", root="fixed")
        with pytest.raises(art.RigError, match=r"rig 'sphere': link 'body': sphere has size \(-1\.0,\)"):
            art.loose_body(art.Sphere(-1.0), root="fixed")
