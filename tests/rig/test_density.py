"""Links filled from their collision shapes, and rigs scaled to a total mass; from text, from Python, from the command line."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
import trimesh

import articulated as art
from articulated import cli

ARM = """<robot name="arm">
  <link name="base"><collision><geometry><box size="1 1 0.1"/></geometry></collision></link>
  <link name="upper">
    <collision><origin xyz="0 0 0.5"/><geometry><cylinder radius="0.1" length="1"/></geometry></collision>
    <visual><geometry><box size="9 9 9"/></geometry></visual>
  </link>
  <link name="lower">
    <inertial><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <collision><geometry><sphere radius="3"/></geometry></collision>
  </link>
  <link name="tool"><visual><geometry><sphere radius="1"/></geometry></visual></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="tool"/></joint>
</robot>"""


def load(text: str = ARM, *arguments, **options) -> art.Rig:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", art.RigWarning)
        return art.load(text, *arguments, **options)


class TestDensity:
    def test_fills_what_has_shapes_and_no_inertial(self):
        with pytest.warns(art.RigWarning) as record:
            rig = art.load(ARM, density=700.0)
        (message,) = (str(one.message) for one in record)
        assert message == (
            "<text>:1: <robot>: links 'base', 'upper' have no <inertial>; "
            "its place is taken by their collision shapes at 700 kg/m³"
        )
        upper, solid = rig.links["upper"], art.mass_properties(art.Cylinder(0.1, 1.0), 700.0)
        assert upper.mass == solid.mass
        np.testing.assert_array_equal(upper.center, [0.0, 0.0, 0.5])
        np.testing.assert_allclose(upper.inertia, solid.inertia, rtol=1e-14)
        assert rig.links["lower"].mass == 2.0
        assert rig.links["tool"].mass == 0.0
        assert rig.links["base"].mass == pytest.approx(70.0)
        assert rig.mass == pytest.approx(solid.mass + 2.0)

    def test_one_link(self):
        text = ARM.replace('<box size="1 1 0.1"/>', '<sphere radius="1"/>').replace("collision", "visual", 2)
        with pytest.warns(art.RigWarning, match=r"link 'upper' has no <inertial>"):
            art.load(text, density=700.0)

    def test_without_it_nothing_changes(self):
        with pytest.raises(art.RigError, match="joint 'shoulder': moves no mass"):
            load()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            art.load("ragdoll", density=1000.0)  # has every <inertial>

    def test_several_shapes_and_a_mesh(self, tmp_path):
        trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / "cube.stl")
        mesh = '<collision><origin xyz="0 0 1"/><geometry><mesh filename="cube.stl" scale="1 1 2"/></geometry></collision>'
        (tmp_path / "arm.urdf").write_text(ARM.replace('<link name="upper">', '<link name="upper">' + mesh))
        rig = load(tmp_path / "arm.urdf", density=700.0)
        both = art.mass_properties(art.Cylinder(0.1, 1.0), 700.0) + art.mass_properties(art.Box((0.2, 0.2, 0.4)), 700.0)
        assert rig.links["upper"].mass == pytest.approx(both.mass, rel=1e-6)

    def test_what_cannot_be_weighed(self, tmp_path):
        mesh = ARM.replace('<cylinder radius="0.1" length="1"/>', '<mesh filename="MESH"/>')
        message = (
            r"link 'upper': its collision shapes cannot be weighed: mesh 'lost\.stl' was not found.*; or give it an <inertial>"
        )
        with pytest.raises(art.RigError, match=message):
            load(mesh.replace("MESH", "lost.stl"), density=700.0)
        cube = trimesh.creation.box((0.2, 0.2, 0.2))
        cube.invert()
        cube.export(tmp_path / "cube.stl")
        text = mesh.replace("MESH", str(tmp_path / "cube.stl"))
        with pytest.raises(art.RigError, match=r"link 'upper': .*this mesh is inside out.*'flip'"):
            load(text, density=700.0, repair_mesh=None)
        assert load(text, density=700.0, repair_mesh="flip").links["upper"].mass == pytest.approx(5.6, rel=1e-6)

    @pytest.mark.parametrize("density", [0.0, -1.0, np.nan, np.inf, "heavy"])
    def test_refused(self, density):
        with pytest.raises(ValueError, match=r"density is .*; expected a positive number of kilograms a cubic metre"):
            load(density=density)


class TestTotalMass:
    @pytest.mark.parametrize("root", ["fixed", "free"])
    def test_everything_is_multiplied_alike(self, root):
        before, after = art.load("ragdoll", root), art.load("ragdoll", root, total_mass=50.0)
        assert after.mass == pytest.approx(50.0, rel=1e-14)
        factor = 50.0 / before.mass
        for a, b in zip(before.links.values(), after.links.values(), strict=True):
            assert b.mass == pytest.approx(factor * a.mass, rel=1e-14)
            np.testing.assert_allclose(b.inertia, factor * a.inertia, rtol=1e-14)
            np.testing.assert_array_equal(b.center, a.center)
        q = before.random(0)
        M0, M1 = (art.mass_matrix(rig, q) - np.diag(rig.armature) for rig in (before, after))
        np.testing.assert_allclose(M1, factor * M0, atol=1e-11)
        np.testing.assert_array_equal(before.damping, after.damping)
        with pytest.raises(ValueError, match="read-only"):
            after.bodies[0].inertia[0] = 0.0

    def test_what_is_fixed_to_the_world_does_not_count(self):
        filled, rig = load(density=700.0), load(density=700.0, total_mass=12.0)
        assert rig.mass == pytest.approx(12.0)
        assert rig.links["base"].mass == pytest.approx(70.0 * 12.0 / filled.mass)
        free = load(ARM, "free", density=700.0, total_mass=12.0)
        assert sum(link.mass for link in free.links.values()) == pytest.approx(12.0)

    def test_from_python(self):
        builder = art.RigBuilder("ball")
        builder.link("ball", collisions=[art.Sphere(0.1)])
        with pytest.warns(art.RigWarning, match=r"rig 'ball': link 'ball' has no <inertial>"):
            rig = builder.build("free", density=500.0, total_mass=3.0)
        assert rig.mass == pytest.approx(3.0)
        np.testing.assert_allclose(rig.links["ball"].inertia, np.eye(3) * 0.4 * 3.0 * 0.01)

    @pytest.mark.parametrize("mass", [0.0, -1.0, np.nan, np.inf, "heavy"])
    def test_refused(self, mass):
        with pytest.raises(ValueError, match=r"total_mass is .*; expected a positive number of kilograms"):
            art.load("ragdoll", total_mass=mass)

    def test_nothing_moves(self):
        builder = art.RigBuilder("rock")
        builder.link("rock", 1.0, inertia=(1, 1, 1))
        with pytest.raises(ValueError, match=r"total_mass is 3\.0, but nothing of rig 'rock' moves; give a root of 'free'"):
            builder.build(total_mass=3.0)


class TestCommandLine:
    def test_info(self, tmp_path, capsys, monkeypatch):
        (tmp_path / "arm.urdf").write_text(ARM)
        monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
            assert cli.main(["info", str(tmp_path / "arm.urdf"), "--density", "700", "--total-mass", "12"]) == 0
        out, err = capsys.readouterr()
        assert "12 kg moving" in out
        assert "links 'base', 'upper' have no <inertial>" in err

    def test_check_compares_the_rig_as_changed(self, capsys):
        assert cli.main(["check", "buggy", "--root", "free", "--total-mass", "12", "--samples", "2"]) == 0
        assert "built joint by joint from the rig" in capsys.readouterr().out

    @pytest.mark.parametrize("option", ["--density", "--total-mass"])
    def test_refused(self, option, capsys):
        with pytest.raises(SystemExit) as stop:
            cli.main(["info", "ragdoll", option, "-1"])
        assert stop.value.code == 2
        assert re.search(rf"{option}: '-1' is not a positive number", capsys.readouterr().err)
