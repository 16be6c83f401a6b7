"""Rigs from Python, what a rig tells of itself, and what loading makes of joints, frames and followers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art


def two_links(**joint) -> art.Rig:
    builder = art.RigBuilder("two")
    builder.link("base", 1.0, inertia=(1.0, 1.0, 1.0))
    builder.link("arm", 2.0, (0.1, 0.2, 0.3), (0.1, 0.1, 0.1))
    joint = {"kind": "revolute", "axis": (0.0, 0.0, 1.0)} | joint
    builder.joint("hinge", joint.pop("kind"), "base", "arm", **joint)
    return builder.build()


class TestLayout:
    def test_tree_order_and_slices(self):
        builder = art.RigBuilder("tree")
        for name in ("root", "a", "b", "a1"):
            builder.link(name, 1.0, inertia=(1.0, 1.0, 1.0))
        builder.joint("to_b", "ball", "root", "b")  # before its sibling, so before its sibling's children
        builder.joint("to_a1", "universal", "a", "a1", axis=(1, 0, 0), axis2=(0, 1, 0))
        builder.joint("to_a", "prismatic", "root", "a")
        rig = builder.build("free")
        assert list(rig.joints) == ["root_joint", "to_b", "to_a", "to_a1"]
        assert [rig.joints[name].q_slice for name in rig.joints] == [slice(0, 7), slice(7, 11), slice(11, 12), slice(12, 14)]
        assert [rig.joints[name].v_slice for name in rig.joints] == [slice(0, 6), slice(6, 9), slice(9, 10), slice(10, 12)]
        assert (rig.nq, rig.nv, rig.mass, rig.nlinks) == (14, 12, 4.0, 4)
        assert [link.index for link in rig.links.values()] == [0, 1, 2, 3]
        assert rig.q_names[6:9] == ["root_joint.qw", "to_b.qx", "to_b.qy"]
        assert rig.v_names[-3:] == ["to_a", "to_a1.1", "to_a1.2"]

    def test_parents_come_first(self):
        for seed in range(20):
            rig = random_rig(seed)
            assert all(body.parent < i for i, body in enumerate(rig.bodies))

    def test_a_rig_is_frozen(self):
        rig = two_links()
        with pytest.raises(dataclasses.FrozenInstanceError):
            rig.name = "other"  # type: ignore[misc]
        with pytest.raises(TypeError):
            rig.joints["hinge"] = None  # type: ignore[index]
        with pytest.raises(ValueError, match="read-only"):
            rig.links["arm"].center[0] = 1.0
        with pytest.raises(ValueError, match="read-only"):
            rig.bodies[0].inertia[0, 0] = 1.0

    def test_repr(self):
        assert repr(two_links()) == "Rig('two', root='fixed', nq=1, nv=1, nbodies=1)"


class TestMerging:
    def test_parallel_axis_theorem(self):
        builder = art.RigBuilder("bar")
        builder.link("base")
        builder.link("left", 1.0, (0.0, 0.0, 0.0), (0.1, 0.2, 0.25))
        builder.link("right", 3.0, (0.0, 0.0, 0.0), (0.2, 0.1, 0.25))
        builder.joint("free", "floating", "base", "left")
        builder.joint("weld", "fixed", "left", "right", xyz=(2.0, 0.0, 0.0), rpy=(0.0, 0.0, np.pi / 2))
        body = builder.build().bodies[0]
        assert body.mass == 4.0
        np.testing.assert_allclose(body.center, [1.5, 0.0, 0.0])
        # reduced mass 3/4 kg, 2 m apart; the right link's x and y moments are exchanged
        np.testing.assert_allclose(body.inertia, np.diag([0.2, 0.4 + 3.0, 0.5 + 3.0]), atol=1e-15)

    def test_merged_links_stay_frames(self):
        builder = art.RigBuilder("frames")
        builder.link("base")
        builder.link("arm", 1.0, inertia=(1, 1, 1))
        builder.link("tool")
        builder.joint("hinge", "revolute", "base", "arm", axis=(0, 0, 1))
        builder.joint("flange", "fixed", "arm", "tool", xyz=(1, 0, 0))
        rig = builder.build()
        pose = art.link_poses(rig, [np.pi / 2])[rig.links["tool"].index]
        np.testing.assert_allclose(pose[:3, 3], [0, 1, 0], atol=1e-15)
        assert rig.links["tool"].joint == "flange"
        assert rig.fixed_joints["flange"].parent == "arm"

    def test_a_chain_of_fixed_joints_changes_nothing(self):
        def build(pieces: int) -> art.Rig:
            builder = art.RigBuilder("chain")
            builder.link("base")
            builder.link("part0", 1.0, inertia=(0.1, 0.1, 0.1))
            builder.joint("hinge", "revolute", "base", "part0", axis=(1, 1, 0))
            for k in range(1, pieces):
                builder.link(f"part{k}", 0.0)
                builder.joint(f"weld{k}", "fixed", f"part{k - 1}", f"part{k}", rpy=(0.1, 0.2, 0.3))
            return builder.build()

        q, v, tau = [0.3], [1.0], [0.5]
        a = art.forward_dynamics(build(1), q, v, tau)
        np.testing.assert_allclose(art.forward_dynamics(build(8), q, v, tau), a, rtol=1e-14)


class TestConfigurations:
    def test_neutral(self):
        rig = random_rig(1)
        for joint in rig.joints.values():
            assert rig.neutral()[joint.q_slice].tolist() == list(_neutral(joint.kind))

    def test_random_keeps_limits_and_norms(self):
        rig = art.load("ragdoll", "free")
        q = rig.random(np.random.default_rng(0), (5, 200))
        assert q.shape == (5, 200, rig.nq)
        for joint in rig.joints.values():
            own = q[..., joint.q_slice]
            if joint.kind in ("ball", "floating"):
                np.testing.assert_allclose(np.linalg.norm(own[..., -4:], axis=-1), 1.0)
            if joint.kind == "ball":
                turn = 2 * np.arccos(np.clip(np.abs(own[..., 3]), 0, 1))
                assert turn.max() <= joint.limits.upper
                assert turn.max() > 0.9 * joint.limits.upper
            if joint.kind in ("revolute", "universal"):
                assert own.min() >= joint.limits.lower
                assert own.max() <= joint.limits.upper
                assert np.ptp(own) > 0.9 * (joint.limits.upper - joint.limits.lower)

    def test_random_is_reproducible(self):
        rig = random_rig(3)
        np.testing.assert_array_equal(rig.random(7), rig.random(np.random.default_rng(7)))

    @pytest.mark.parametrize(("lower", "upper"), [(5.0, np.inf), (-np.inf, -5.0), (-np.inf, np.inf), (5.0, 6.0)])
    def test_random_with_limits_on_one_side(self, lower, upper):
        rig = two_links(kind="prismatic", limits=art.Limits(lower, upper))
        q = rig.random(0, 500)
        assert lower <= q.min() < q.max() <= upper
        assert np.isfinite(q).all()


class TestFollowers:
    def build(self) -> art.Rig:
        builder = art.RigBuilder("gripper")
        builder.link("palm", 1.0, inertia=(1, 1, 1))
        for k, mimic in enumerate([None, art.Mimic("f0", -1.0, 0.1), art.Mimic("f1", 2.0, 0.2)]):
            builder.link(f"finger{k}", 0.1, (0.05, 0, 0), (1e-3, 1e-3, 1e-3))
            builder.joint(f"f{k}", "revolute", "palm", f"finger{k}", xyz=(0, 0.1 * k, 0), axis=(0, 0, 1), armature=0.5, mimic=mimic,
                          friction=1.0)  # fmt: skip
        return builder.build("free")

    def test_followers_have_no_coordinates(self):
        rig = self.build()
        assert (rig.nq, rig.nv) == (8, 7)
        assert rig.joints["f1"].nq == 0
        assert rig.joints["f1"].q_slice == slice(8, 8)

    def test_a_follower_of_a_follower_follows_the_first(self):
        mimic = self.build().joints["f2"].mimic
        assert mimic == art.Mimic("f0", -2.0, 0.4)  # 2 (-q + 0.1) + 0.2

    def test_rotors_and_friction_count_at_the_leader(self):
        rig = self.build()
        assert rig.armature[6] == pytest.approx(0.5 * (1 + 1 + 4))
        assert rig.friction[6] == pytest.approx(1 + 1 + 2)

    def test_poses(self):
        rig = self.build()
        q = rig.neutral()
        q[7] = 0.3
        poses = art.link_poses(rig, q)
        for name, angle in (("finger0", 0.3), ("finger1", -0.2), ("finger2", -0.2)):
            R = poses[rig.links[name].index, :2, :2]
            np.testing.assert_allclose(R, [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]], atol=1e-15)


class TestWithJoints:
    def test_all_but_the_root(self):
        rig = art.load("pendulum", "free").with_joints(damping=2.0)
        assert rig.damping.tolist() == [0.0] * 6 + [2.0] * 6

    def test_by_name(self):
        rig = art.load("pendulum").with_joints(armature={"elbow": 0.1})
        assert rig.armature.tolist() == [0.0] * 3 + [0.1] * 3

    @pytest.mark.parametrize(
        ("properties", "message"),
        [
            ({"colour": 1.0}, "unknown joint property 'colour'"),
            ({"damping": {"knee": 1.0}}, "no moving joint 'knee'"),
            ({"damping": -1.0}, "damping of joint 'shoulder' is -1.0; expected a finite number"),
        ],
    )
    def test_bad(self, properties, message):
        with pytest.raises(ValueError, match=message):
            art.load("pendulum").with_joints(**properties)


class TestBuilderErrors:
    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"mass": "heavy"}, "rig 'r': link 'l': mass is 'heavy'; give a number"),
            ({"mass": float("nan")}, "link 'l': mass is nan"),
            ({"mass": 1.0, "inertia": (1.0, 1.0)}, r"inertia has shape \(2,\); give shape \(3, 3\)"),
            ({"mass": 1.0, "inertia": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, "inertia is not a symmetric matrix"),
            ({"mass": 1.0, "inertia": "round"}, "inertia is 'round'"),
            ({"center": (0.0, 0.0)}, r"center has shape \(2,\); give shape \(3,\)"),
            ({"center": (0.0, 0.0, float("inf"))}, "centre of mass is not finite"),
            ({"name": ""}, "has no name"),
            ({"collisions": [art.Capsule(0.1, float("nan"))]}, "capsule has size"),
        ],
    )
    def test_link(self, arguments, message):
        with pytest.raises(art.RigError, match=message):
            art.RigBuilder("r").link(**({"name": "l"} | arguments))

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"kind": "hinge joint"}, "rig 'r': joint 'j': unknown joint type 'hinge joint'"),
            ({"axis": (0, 0)}, r"axis has shape \(2,\)"),
            ({"axis": (0, 0, 0)}, "axis is the zero vector"),
            ({"rpy": (0, 0)}, r"rpy has shape \(2,\)"),
            ({"xyz": (0, 0, float("nan"))}, "origin is not finite"),
            ({"pose": 2 * np.eye(4)}, "pose is not a rotation and a translation"),
            ({"pose": np.diag([1, 1, -1, 1])}, "pose is not a rotation and a translation"),
            ({"damping": None}, "damping is None"),
            ({"limits": art.Limits(1.0, 0.0)}, "lower limit 1 is not below upper limit 0"),
            ({"kind": "ball", "limits": art.Limits(-3.0, -1.0)}, "upper limit of a ball joint is -1"),
        ],
    )
    def test_joint(self, arguments, message):
        with pytest.raises(art.RigError, match=message):
            art.RigBuilder("r").joint("j", **({"kind": "revolute", "parent": "a", "child": "b"} | arguments))

    def test_tree_errors_are_the_reader_s(self):
        builder = art.RigBuilder("r")
        builder.link("a")
        builder.joint("j", "ball", "a", "b")
        with pytest.raises(art.RigError, match=r"rig 'r': joint 'j': its child link 'b' does not exist"):
            builder.build()


class TestShapesAndAdditions:
    def test_urdf_1_2(self):
        rig = art.load(
            """<robot name="new" version="1.2">
            <link name="a"><collision name="pad"><origin xyz="1 0 0" quat_xyzw="0 0 1 0"/>
              <geometry><capsule radius="0.1" length="0.5"/></geometry></collision></link>
            <link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
              <limit lower="-1" upper="1" effort="2" velocity="3" acceleration="4" deceleration="5" jerk="6"/></joint></robot>"""
        )
        shape = rig.links["a"].collisions[0]
        assert shape.geometry == art.Capsule(0.1, 0.5)
        assert shape.name == "pad"
        np.testing.assert_allclose(shape.pose, [[-1, 0, 0, 1], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-15)
        assert rig.joints["j"].limits == art.Limits(-1, 1, 2, 3, 4, 5, 6)

    def test_an_inertia_in_turned_axes(self):
        rig = art.load(
            """<robot name="turned"><link name="a"><inertial><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>
            <mass value="1"/><inertia ixx="1" ixy="0.1" ixz="0" iyy="2" iyz="0.2" izz="2.5"/></inertial></link></robot>"""
        )
        np.testing.assert_allclose(rig.links["a"].center, [1, 2, 3])
        # x becomes y, y becomes -x
        np.testing.assert_allclose(rig.links["a"].inertia, [[2, -0.1, -0.2], [-0.1, 1, 0], [-0.2, 0, 2.5]], atol=1e-15)

    def test_colors_by_name(self):
        rig = art.load(
            """<robot name="c"><material name="red"><color rgba="1 0 0 1"/></material>
            <link name="a"><visual><geometry><sphere radius="1"/></geometry><material name="red"/></visual></link></robot>"""
        )
        assert rig.links["a"].visuals[0].color == (1.0, 0.0, 0.0, 1.0)

    @pytest.mark.parametrize("scale", ["2", "2 2 2"])
    def test_mesh_scale(self, scale):
        text = f'<robot name="m"><link name="a"><visual><geometry><mesh filename="x.stl" scale="{scale}"/></geometry></visual></link></robot>'
        with pytest.warns(art.RigWarning, match="x.stl"):
            assert art.load(text).links["a"].visuals[0].geometry.scale == (2.0, 2.0, 2.0)

    def test_mesh_dirs(self, tmp_path):
        (tmp_path / "robot" / "meshes").mkdir(parents=True)
        (tmp_path / "robot" / "meshes" / "x.stl").touch()
        text = '<robot name="m"><link name="a"><visual><geometry><mesh filename="package://robot/meshes/x.stl"/></geometry></visual></link></robot>'
        for directory in (tmp_path, str(tmp_path / "robot"), [tmp_path]):
            mesh = art.load(text, mesh_dirs=directory).links["a"].visuals[0].geometry
            assert mesh.path == tmp_path / "robot" / "meshes" / "x.stl"

    def test_ros_package_path(self, tmp_path, monkeypatch):
        (tmp_path / "robot").mkdir()
        (tmp_path / "robot" / "r.urdf").write_text('<robot name="found"><link name="a"/></robot>')
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
        assert art.load("package://robot/r.urdf").name == "found"

    @pytest.mark.parametrize("alias", ["spherical", "ball"])
    def test_aliases(self, alias):
        assert two_links(kind=alias).joints["hinge"].kind == "ball"

    def test_text_with_byte_order_mark(self):
        assert art.load('\ufeff<?xml version="1.0"?>\n<robot name="b"><link name="a"/></robot>').name == "b"
        assert art.load(b'<?xml version="1.0" encoding="iso-8859-1"?><robot name="\xe9"><link name="a"/></robot>').name == "é"


class TestShipped:
    @pytest.mark.parametrize("name", sorted(art.shipped_rigs()))
    def test_loads(self, name):
        assert art.load(name).nv > 0 or len(art.load(name).links) == 1  # a ball and a box have a free root only
        assert art.load(name, "free").mass > 0

    def test_files_are_what_the_script_makes(self, monkeypatch):
        path = art.shipped_rigs()["ragdoll"].parent
        monkeypatch.syspath_prepend(str(path))
        import make_rigs

        for make in make_rigs.MAKERS:
            assert (path / f"{make.__name__}.urdf").read_text() == make().build().to_urdf()

    def test_a_path_wins_over_a_name(self, tmp_path, monkeypatch):
        (tmp_path / "ragdoll").write_text('<robot name="mine"><link name="a"/></robot>')
        monkeypatch.chdir(tmp_path)
        assert art.load("ragdoll").name == "mine"


def _neutral(kind: str) -> tuple[float, ...]:
    return {"ball": (0, 0, 0, 1), "floating": (0, 0, 0, 0, 0, 0, 1), "planar": (0, 0, 0), "universal": (0, 0)}.get(kind, (0,))
