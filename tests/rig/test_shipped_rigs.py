"""What each shipped rig is: read again, and read by others."""

from __future__ import annotations

import math
import re
import sys
import warnings

import numpy as np
import pytest
from lxml import etree
from scipy.spatial.transform import Rotation

import articulated as art
from articulated import cli
from articulated.crosscheck import PinocchioModel
from articulated.rig.load import shipped_lines

mujoco = pytest.importorskip("mujoco")
pinocchio = pytest.importorskip("pinocchio")

RIGS = sorted(art.shipped_rigs())
KNOWN_TO_PINOCCHIO = {"revolute", "continuous", "prismatic", "planar", "floating"}
"""Kinds of moving joints of URDF 1.0, which its reader documents; ball and universal joints it refuses."""


def text_of(name: str) -> str:
    return art.shipped_rigs()[name].read_text()


NUMBER = re.compile(r"-?\d+\.?\d*(e-?\d+)?(?=[ \"])")


def numbers(text: str) -> list[float]:
    return [float(match[0]) for match in NUMBER.finditer(text)]


def total_mass(rig: art.Rig) -> float:
    """Of all links, those of the base too."""
    return sum(link.mass for link in rig.links.values())


def places(rig: art.Rig) -> dict[str, np.ndarray]:
    """Where links are at neutral."""
    return {link.name: X for link, X in zip(rig.links.values(), art.link_poses(rig, rig.neutral()), strict=True)}


class TestShipped:
    def test_all_that_were_asked_for(self):
        wanted = "ragdoll ponytail car telescope quadruped four_bar strandbeest double_pendulum ball box bicyclist"
        assert set(wanted.split()) <= set(RIGS)

    @pytest.mark.parametrize("name", RIGS)
    def test_round_trip(self, name):
        rig = art.load(name)
        again = art.load(rig.to_urdf())
        for text in (rig.to_urdf(), again.to_urdf()):  # turned shapes may differ in the last digit of their quaternions
            assert NUMBER.sub("#", text) == NUMBER.sub("#", text_of(name))
            assert np.allclose(numbers(text), numbers(text_of(name)), rtol=1e-15, atol=1e-15)
        assert (again.nq, again.nv, again.mass) == (rig.nq, rig.nv, rig.mass)
        assert [str(loop) for loop in again.loops] == [str(loop) for loop in rig.loops]

    @pytest.mark.parametrize("name", RIGS)
    def test_loops_are_closed_at_neutral(self, name):
        rig = art.load(name, "free")
        if rig.loops:
            assert np.abs(art.loop_gaps(rig, None, rig.neutral())).max() < 1e-9

    @pytest.mark.parametrize("name", sorted(set(RIGS) - {"ragdoll"}))
    def test_inertias_are_those_of_what_it_looks_like(self, name):
        """Of the visual shapes together; extra looks (a nose, lamps) and hollow balls aside."""
        rig, looked_at = art.load(name, "free"), 0
        for link in rig.links.values():
            touching = [(shape.geometry, shape.pose.tobytes()) for shape in link.collisions]
            looking = [(shape.geometry, shape.pose.tobytes()) for shape in link.visuals]
            if not link.visuals or name == "ball" or (touching and touching != looking and len(touching) != len(looking)):
                continue
            solid = art.mass_properties(list(link.visuals), mass=link.mass)
            assert np.allclose(link.center, solid.center, atol=1e-6)
            assert np.allclose(link.inertia, solid.inertia, rtol=2e-5, atol=1e-5 * np.abs(solid.inertia).max())
            looked_at += 1
        assert looked_at or name == "ball"

    def test_a_ball_is_hollow(self):
        ball = art.load("ball", "free").links["ball"]
        assert np.allclose(np.diag(ball.inertia), 2.0 / 3.0 * ball.mass * 0.11**2, rtol=1e-4)

    @pytest.mark.parametrize("name", RIGS)
    def test_it_can_touch_and_be_seen(self, name):
        rig = art.load(name, "free")
        assert any(link.visuals for link in rig.links.values())
        assert np.isfinite(art.standing_height(rig))

    @pytest.mark.parametrize("name", ["ponytail", "car", "telescope", "quadruped", "bicyclist"])
    def test_joints_that_hold_things_have_limits_and_damping(self, name):
        for joint in art.load(name).joints.values():
            if joint.kind not in ("continuous", "universal") and not joint.mimic:
                assert math.isfinite(joint.limits.upper), joint.name
                assert joint.damping > 0.0, joint.name

    def test_masses(self):
        masses = {name: art.load(name, "free").mass for name in RIGS}
        assert masses["car"] == pytest.approx(1100.0)
        assert masses["quadruped"] == pytest.approx(12.0)
        assert masses["bicyclist"] == pytest.approx(75.0 + 13.0, abs=1.0)


class TestLines:
    def test_each_has_one(self, monkeypatch):
        lines = shipped_lines()
        assert sorted(lines) == RIGS
        monkeypatch.syspath_prepend(str(art.shipped_rigs()["ball"].parent))
        import make_rigs

        assert (art.shipped_rigs()["ball"].parent / "rigs.txt").read_text(encoding="utf-8") == make_rigs.lines()

    def test_the_command_line_shows_them(self, capsys):
        assert cli.main(["rigs"]) == 0
        for line, (name, what) in zip(capsys.readouterr().out.splitlines(), sorted(shipped_lines().items()), strict=True):
            assert line.startswith(name)
            assert what in line

    def test_rigs_without_one_are_listed_all_the_same(self, capsys, monkeypatch, tmp_path):
        (tmp_path / "mine.urdf").write_text('<robot name="mine"><link name="a"/></robot>')
        monkeypatch.setattr(sys.modules["articulated.rig.load"], "_SHIPPED", (tmp_path,))
        assert shipped_lines() == {}
        (tmp_path / "rigs.txt").write_text("\nno colon\nother: thing\n:\n")
        assert shipped_lines() == {"other": "thing"}
        assert cli.main(["rigs"]) == 0
        assert capsys.readouterr().out.startswith("mine ")


class TestPinocchio:
    @pytest.mark.parametrize("name", RIGS)
    def test_it_loads(self, name):
        """Its own reader takes what has only joints of URDF 1.0, quat_xyzw included; others are handed over joint by joint."""
        rig = art.load(name)
        if {joint.kind for joint in rig.joints.values()} <= KNOWN_TO_PINOCCHIO:
            model = pinocchio.buildModelFromXML(text_of(name))
        else:
            with pytest.raises(ValueError, match="valid URDF"):
                pinocchio.buildModelFromXML(text_of(name))
            model = PinocchioModel.from_rig(art.load(name, "free")).model
        assert sum(inertia.mass for inertia in model.inertias) == pytest.approx(total_mass(rig), rel=1e-12)
        data = model.createData()
        pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
        for link, X in places(rig).items():
            frame = model.getFrameId(link, pinocchio.FrameType.BODY)
            assert np.allclose(data.oMf[frame].homogeneous, X, atol=1e-9)


class TestMuJoCo:
    """Its reader knows a ball joint as type="spherical" (not "ball"), and no universal one: these become spherical here, with the
    same links in the same places. It passes over quat_xyzw, so that orientations are given as rpy; over <constraint>, so that
    loops are open; and over what <mimic> says. Links fixed to the world are kept, with their masses, by fusestatic="false".
    """

    @staticmethod
    def translated(text: str) -> str:
        robot = etree.fromstring(text)
        for element in robot.iter():
            if quat := element.attrib.pop("quat_xyzw", None):
                with warnings.catch_warnings():  # where two of these angles do the same, one may be 0
                    warnings.simplefilter("ignore")
                    rpy = Rotation.from_quat([float(x) for x in quat.split()]).as_euler("xyz")
                element.set("rpy", " ".join(map(repr, rpy.tolist())))
        for joint in robot.iter("joint"):
            if joint.get("type") == "universal":
                for limit in joint.findall("limit"):  # of two axes; a ball's would have to begin at 0
                    joint.remove(limit)
            if joint.get("type") in ("ball", "universal"):
                joint.set("type", "spherical")
        options = etree.SubElement(robot, "mujoco")
        etree.SubElement(options, "compiler", fusestatic="false", balanceinertia="false", discardvisual="true")
        return etree.tostring(robot, encoding="unicode")

    @pytest.mark.parametrize("name", RIGS)
    def test_it_loads(self, name):
        rig = art.load(name)
        model = mujoco.MjModel.from_xml_string(self.translated(text_of(name)))
        assert model.body_mass.sum() == pytest.approx(total_mass(rig), rel=1e-12)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        for link, X in places(rig).items():
            assert np.allclose(data.body(link).xpos, X[:3, 3], atol=1e-9)
            assert np.allclose(data.body(link).xmat.reshape(3, 3), X[:3, :3], atol=1e-9)

    @pytest.mark.parametrize("name", ["pendulum", "ponytail", "ragdoll"])
    def test_what_it_does_not_know_as_it_stands(self, name):
        with pytest.raises(ValueError, match="invalid joint type"):
            mujoco.MjModel.from_xml_string(text_of(name))
