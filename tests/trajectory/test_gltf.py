"""Motions as .glb, read back by hand: the file's own tree and animation are the rig's, and its triangles the shapes'."""

from __future__ import annotations

import errno
import math
import sys
import warnings

import numpy as np
import pytest
import trimesh
from glb_file import COMPONENTS, SIZES, GlbFile
from PIL import Image
from random_trees import KINDS, random_rig

import articulated as art
from articulated import particles as ap
from articulated.trajectory import files
from articulated.trajectory.gltf import write_glb
from articulated.trajectory.gltf_document import Document
from articulated.trajectory.surfaces import Surface

Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From the rig's world to the file's."""


@pytest.fixture(autouse=True)
def on_numpy(interpreted):
    """Rigs are many here, and states few."""


def written(tmp_path, rig, q, time=None, **options) -> GlbFile:
    path = tmp_path / "motion.glb"
    write_glb(rig, np.arange(len(q)) / 10.0 if time is None else time, q, path, **options)
    return GlbFile(path)


def hinge(*shapes: art.Shape, kind: str = "revolute", visuals=()) -> art.Rig:
    builder = art.RigBuilder("hinge")
    builder.link("base")
    builder.link("arm", 1.0, inertia=(1, 1, 1), collisions=list(shapes), visuals=list(visuals))
    builder.joint("elbow", kind, "base", "arm", xyz=(0, 0, 1), axis=(0, 1, 0))
    return builder.build()


def assert_same_motion(glb: GlbFile, rig: art.Rig, q: np.ndarray) -> None:
    X = art.link_poses(rig, q)
    for frame in range(len(q)):
        worlds = glb.worlds(frame)
        for name, link in rig.links.items():
            world = worlds[glb.number[name]]
            np.testing.assert_allclose(world[:3, :3], Y_UP @ X[frame, link.index, :3, :3], atol=3e-6)
            np.testing.assert_allclose(world[:3, 3], Y_UP @ X[frame, link.index, :3, 3], atol=3e-6)


class TestMotion:
    def test_every_joint_kind_is_among_the_trees(self):
        kinds = {joint.kind for seed in range(8) for joint in random_rig(seed, mimic=True).joints.values()}
        assert kinds == set(KINDS)
        assert any(joint.mimic for seed in range(8) for joint in random_rig(seed, mimic=True).joints.values())

    @pytest.mark.parametrize("seed", range(8))
    def test_the_files_own_kinematics_are_the_rigs(self, tmp_path, seed):
        rig = random_rig(seed, mimic=True)
        q = rig.random(seed, 6)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", art.RigWarning)  # wild turns
            assert_same_motion(written(tmp_path, rig, q), rig, q)

    @pytest.mark.parametrize(
        ("name", "root"), [("ragdoll", "free"), ("four_bar", "fixed"), ("buggy", "planar"), ("ponytail", "free")]
    )
    def test_shipped_rigs(self, tmp_path, name, root):
        rig = art.load(name, root)
        q = rig.random(1, 3)
        assert_same_motion(written(tmp_path, rig, q), rig, q)

    def test_nodes_are_the_tree(self, tmp_path):
        rig = art.load("buggy", "free")
        glb = written(tmp_path, rig, rig.random(0, 2))
        (top,) = glb.json["scenes"][glb.json["scene"]]["nodes"]
        assert glb.nodes[top]["name"] == "buggy (z up)"
        for link in rig.links.values():
            joint = rig.joints.get(link.joint) or rig.fixed_joints.get(link.joint)
            above = glb.number[joint.parent] if joint and joint.parent else top
            assert glb.parent[glb.number[link.name]] == above
            about = glb.nodes[glb.number[link.name]].get("extras", {}).get("joint")
            assert (about or {}).get("name") == (link.joint if link.joint in rig.joints else None)
            if about:
                assert about["kind"] == rig.joints[link.joint].kind
                assert ("lower" in about) == math.isfinite(rig.joints[link.joint].limits.lower)

    def test_only_what_moves_has_channels(self, tmp_path):
        rig = random_rig(3)
        q = rig.random(0, 4)
        glb = written(tmp_path, rig, q)
        expected = set()
        for joint in rig.joints.values():
            if joint.kind in ("prismatic", "planar", "floating"):
                expected.add((glb.number[joint.child], "translation"))
            if joint.kind != "prismatic":
                expected.add((glb.number[joint.child], "rotation"))
        assert set(glb.channels) == expected

    def test_what_holds_still_has_none(self, tmp_path):
        rig = art.load("ragdoll", "free")
        q = np.tile(rig.neutral(), (3, 1))
        q[:, rig.joints["left_elbow"].q_slice] = [[0.0], [0.1], [0.2]]
        glb = written(tmp_path, rig, q)
        assert list(glb.channels) == [(glb.number["left_forearm"], "rotation")]

    @pytest.mark.parametrize("frames", [1, 2, 5])
    def test_there_is_an_animation_even_of_what_does_not_move(self, tmp_path, frames):
        rig = hinge()
        glb = written(tmp_path, rig, np.zeros((frames, 1)))
        ((time, values),) = glb.channels.values()
        assert len(time) == len(values) == min(frames, 2)
        assert time[-1] == pytest.approx((frames - 1) / 10.0)
        assert_same_motion(glb, rig, np.zeros((1, 1)))

    def test_a_rig_that_cannot_move(self, tmp_path):
        builder = art.RigBuilder("rock")
        builder.link("rock", 1.0, inertia=(1, 1, 1), collisions=[art.Sphere(0.5)])
        glb = written(tmp_path, builder.build(), np.zeros((3, 0)))
        assert len(glb.channels) == 1
        assert "rock" in glb.number

    def test_turns_go_on_through_many_turns(self, tmp_path):
        angles = np.linspace(0.0, 20.0, 60)
        glb = written(tmp_path, hinge(kind="continuous"), angles[:, None])
        ((_, quats),) = glb.channels.values()
        assert np.sum(quats[1:] * quats[:-1], axis=1).min() > 0.98
        np.testing.assert_allclose(np.linalg.norm(quats, axis=1), 1.0, atol=1e-6)
        middle = quats[1:] + quats[:-1]  # what a player shows between two frames
        half = 0.25 * (angles[1:] + angles[:-1])
        middle /= np.linalg.norm(middle, axis=1, keepdims=True) * np.sign(middle[:, 3] * np.cos(half))[:, None]
        np.testing.assert_allclose(middle[:, 1], np.sin(half), atol=1e-6)

    def test_quaternions_of_either_sign(self, tmp_path):
        rig = art.load("pendulum")
        q = rig.random(0, 1).repeat(4, axis=0)
        q[1::2, rig.joints["shoulder"].q_slice] *= -1.0
        glb = written(tmp_path, rig, q)
        assert list(glb.channels) == [(0, "rotation")]  # nothing moves

    def test_time_begins_at_zero(self, tmp_path):
        glb = written(tmp_path, hinge(), [[0.0], [0.5], [0.7]], time=[3.0, 3.5, 3.75])
        ((time, _),) = glb.channels.values()
        np.testing.assert_array_equal(time, [0.0, 0.5, 0.75])

    def test_turns_too_fast_to_be_seen_are_told_of(self, tmp_path):
        with pytest.warns(art.RigWarning, match=r"half a turn or more from frame to frame: elbow \(by up to 229°\); in a .glb"):
            written(tmp_path, hinge(kind="continuous"), [[0.0], [4.0]])


class TestFile:
    @pytest.fixture
    def glb(self, tmp_path):
        rig = art.load("ragdoll", "free")
        return written(tmp_path, rig, rig.random(0, 5), ground=True)

    def test_views_are_aligned_and_within_the_buffer(self, glb):
        (buffer,) = glb.json["buffers"]
        assert 0 <= len(glb.buffer) - buffer["byteLength"] < 4
        ends = 0
        for view in glb.json["bufferViews"]:
            start = view.get("byteOffset", 0)
            assert start % 4 == 0
            assert start >= ends
            ends = start + view["byteLength"]
        assert ends <= buffer["byteLength"]

    def test_bounds(self, glb):
        needed = {channel["input"] for channel in glb.animation["samplers"]}
        for mesh in glb.json["meshes"]:
            needed |= {primitive["attributes"]["POSITION"] for primitive in mesh["primitives"]}
        for k in needed:
            values, about = glb.values(k), glb.json["accessors"][k]
            np.testing.assert_array_equal(np.ravel(values.min(axis=0)), about["min"])
            np.testing.assert_array_equal(np.ravel(values.max(axis=0)), about["max"])
        for about in glb.json["accessors"]:
            view = glb.json["bufferViews"][about["bufferView"]]
            assert view["byteLength"] == about["count"] * SIZES[about["type"]] * COMPONENTS[about["componentType"]].itemsize

    def test_triangles_have_corners(self, glb):
        for mesh in glb.json["meshes"]:
            for primitive in mesh["primitives"]:
                count = len(glb.values(primitive["attributes"]["POSITION"]))
                normals = glb.values(primitive["attributes"]["NORMAL"])
                corners = glb.values(primitive["indices"])
                assert len(normals) == count
                assert len(corners) % 3 == 0
                assert corners.max() < count
                np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)

    @pytest.mark.parametrize(("count", "component"), [(65534, 5123), (65535, 5125), (70000, 5125)])
    def test_many_corners_have_long_numbers(self, tmp_path, count, component):
        document = Document("test")
        points = np.zeros((count, 3), np.float32)
        _, _, corners = document.triangles(Surface(points, points, np.array([[0, 1, count - 1]])))
        document.animation("none", np.zeros(1), [(document.node("top"), "translation", np.zeros((1, 3)))])
        (tmp_path / "many.glb").write_bytes(document.bytes())
        glb = GlbFile(tmp_path / "many.glb")
        np.testing.assert_array_equal(glb.values(corners), [0, 1, count - 1])
        assert glb.json["accessors"][corners]["componentType"] == component

    def test_ground(self, glb):
        points = glb.points(glb.number["ground"])
        assert points[:, 1].max() == pytest.approx(0.0, abs=1e-6)
        assert np.ptp(points[:, 0]) > 4.0

    def test_no_ground_unless_asked_for(self, tmp_path):
        assert "ground" not in written(tmp_path, hinge(), np.zeros((2, 1))).number


class TestShapes:
    def test_stand_where_they_should(self, tmp_path):
        pose = np.eye(4)
        pose[:3, 3] = (0.5, 0, 0)
        glb = written(tmp_path, hinge(art.Shape(art.Box((0.4, 0.2, 0.1)), pose, "blade")), [[0.0], [0.5 * math.pi]])
        node = glb.number["arm blade 0"]
        low, high = glb.points(node, 0).min(axis=0), glb.points(node, 0).max(axis=0)
        np.testing.assert_allclose([low, high], [[0.3, 0.95, -0.1], [0.7, 1.05, 0.1]], atol=1e-6)
        low, high = glb.points(node, 1).min(axis=0), glb.points(node, 1).max(axis=0)
        np.testing.assert_allclose([low, high], [[-0.05, 0.3, -0.1], [0.05, 0.7, 0.1]], atol=1e-6)

    def test_are_in_the_file_once(self, tmp_path):
        red = (1.0, 0.0, 0.0, 1.0)
        shapes = [art.Shape(art.Sphere(0.1)), art.Shape(art.Sphere(0.1)), art.Shape(art.Sphere(0.1), color=red)]
        glb = written(tmp_path, hinge(*shapes), np.zeros((2, 1)))
        first, second, third = (glb.nodes[glb.number[f"arm shape {k}"]]["mesh"] for k in range(3))
        assert first == second != third
        points = {mesh["primitives"][0]["attributes"]["POSITION"] for mesh in glb.json["meshes"]}
        assert (len(glb.json["meshes"]), len(points)) == (2, 1)

    def test_looks_come_before_contact_shapes(self, tmp_path):
        glb = written(tmp_path, hinge(art.Shape(art.Sphere(0.1)), visuals=[art.Shape(art.Box((1, 1, 1)))]), np.zeros((2, 1)))
        (mesh,) = glb.json["meshes"]
        assert len(glb.values(mesh["primitives"][0]["attributes"]["POSITION"])) == 24

    def test_colours(self, tmp_path):
        shapes = [art.Shape(art.Sphere(0.1), color=(1.0, 0.5, 0.0, alpha)) for alpha in (1.0, 0.25)]
        glb = written(tmp_path, hinge(*shapes), np.zeros((2, 1)))
        solid, glass = glb.json["materials"]
        # IEC 61966-2-1: an sRGB value of 0.5 is 0.2140 of the light
        np.testing.assert_allclose(solid["pbrMetallicRoughness"]["baseColorFactor"], [1, 0.21404, 0, 1], atol=1e-5)
        assert (solid["alphaMode"], glass["alphaMode"]) == ("OPAQUE", "BLEND")
        assert glass["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.25

    def test_both_sides_of_a_body_have_one_colour(self, tmp_path):
        glb = written(tmp_path, art.load("ragdoll", "free"), art.load("ragdoll", "free").random(0, 2))

        def color(link: str) -> int:
            node = next(k for k, node in enumerate(glb.nodes) if "mesh" in node and glb.parent[k] == glb.number[link])
            return glb.json["meshes"][glb.nodes[node]["mesh"]]["primitives"][0]["material"]

        assert color("left_forearm") == color("right_forearm") != color("left_upper_arm")


class TestMeshes:
    @pytest.fixture
    def brick(self, tmp_path):
        trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "brick.stl")
        return tmp_path / "brick.stl"

    def test_are_scaled(self, tmp_path, brick):
        shape = art.Shape(art.Mesh("brick.stl", (0.1, 0.2, -0.3), brick))
        glb = written(tmp_path, hinge(shape), np.zeros((2, 1)))
        points = glb.points(glb.number["arm shape 0"])
        np.testing.assert_allclose(np.ptp(points, axis=0), [0.1, 0.9, 0.4], atol=1e-6)

    def test_in_two_sizes_are_in_the_file_once(self, tmp_path, brick):
        shapes = [art.Shape(art.Mesh("brick.stl", (s, s, s), brick)) for s in (1.0, 2.0)]
        glb = written(tmp_path, hinge(*shapes), np.zeros((2, 1)))
        assert len(glb.json["meshes"]) == 1

    def test_have_the_colours_of_their_files(self, tmp_path, robots):
        rig = art.load(robots / "ur_description/urdf/ur5_robot.urdf")
        glb = written(tmp_path, rig, rig.random(0, 2))
        assert len(glb.json["materials"]) > 3
        X = art.link_poses(rig, rig.random(0, 2))
        for link in rig.links.values():
            for k, shape in enumerate(link.visuals):
                ours = glb.points(glb.number[f"{link.name} shape {k}"], frame=1)
                given = trimesh.load(shape.geometry.path, force="mesh").vertices  # as everything else reads it
                given = given @ shape.pose[:3, :3].T + shape.pose[:3, 3]
                given = (given @ X[1, link.index, :3, :3].T + X[1, link.index, :3, 3]) @ Y_UP.T
                np.testing.assert_allclose(ours.min(axis=0), given.min(axis=0), atol=1e-5)
                np.testing.assert_allclose(ours.max(axis=0), given.max(axis=0), atol=1e-5)

    def test_linear_colours_of_a_glb_come_out_as_they_went_in(self, tmp_path):
        builder = hinge(art.Shape(art.Sphere(0.1), color=(0.8, 0.4, 0.2, 1.0)))
        first = written(tmp_path, builder, np.zeros((2, 1)))
        (tmp_path / "motion.glb").rename(tmp_path / "ball.glb")
        again = written(tmp_path, hinge(art.Shape(art.Mesh("ball.glb", path=tmp_path / "ball.glb"))), np.zeros((2, 1)))
        before, after = (glb.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] for glb in (first, again))
        np.testing.assert_allclose(after, before, atol=1 / 255)

    def test_not_found(self, tmp_path, brick):
        lost = art.Shape(art.Mesh("lost.stl"))
        with pytest.warns(
            art.RigWarning, match=r"hinge: meshes that were not found are not drawn: lost.stl; give load its mesh_dirs"
        ):
            glb = written(tmp_path, hinge(visuals=[lost, art.Shape(art.Mesh("b", path=brick))]), np.zeros((2, 1)))
        assert len(glb.json["meshes"]) == 1

    def test_none_found(self, tmp_path):
        """Contact shapes are better than nothing."""
        rig = hinge(art.Shape(art.Sphere(0.1)), visuals=[art.Shape(art.Mesh("lost.stl"))])
        with pytest.warns(art.RigWarning, match=r"not drawn: lost.stl"):
            glb = written(tmp_path, rig, np.zeros((2, 1)))
        assert "arm shape 0" in glb.number

    def test_no_triangles_or_broken(self, tmp_path):
        (tmp_path / "bad.stl").write_text("no mesh")
        rig = hinge(art.Shape(art.Mesh("bad.stl", path=tmp_path / "bad.stl")))
        with pytest.warns(art.RigWarning, match=r"link 'arm': a mesh is not drawn; .*bad.stl: this mesh"):
            glb = written(tmp_path, rig, np.zeros((2, 1)))
        assert "meshes" not in glb.json

    def test_gone_since(self, tmp_path):
        rig = hinge(art.Shape(art.Mesh("gone.stl", path=tmp_path / "gone.stl")))
        with pytest.warns(art.RigWarning, match=r"gone.stl: no such file"):
            written(tmp_path, rig, np.zeros((2, 1)))

    def test_pictures_are_left_out(self, tmp_path):
        Image.new("RGB", (2, 2), (200, 10, 10)).save(tmp_path / "skin.png")
        (tmp_path / "sheet.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
        faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl skin\nf 1/1 2/2 3/3\n"
        (tmp_path / "sheet.obj").write_text("mtllib sheet.mtl\n" + faces)
        rig = hinge(art.Shape(art.Mesh("sheet.obj", path=tmp_path / "sheet.obj")))
        with pytest.warns(art.RigWarning, match=r"pictures on meshes are left out: sheet.obj; each is drawn in one colour"):
            written(tmp_path, rig, np.zeros((2, 1)))


class TestBadInput:
    @pytest.mark.parametrize(
        ("time", "q", "message"),
        [
            (
                [0.0, 1.0],
                [[0.0, 0.0]] * 2,
                r"time has shape \(2,\) and q \(2, 2\); expected \(T,\) and \(T, 1\) for one motion of rig",
            ),
            ([0.0], [[0.0]] * 2, r"time has shape \(1,\) and q \(2, 1\)"),
            ([0.0, 1.0], [[[0.0]], [[0.0]]], r"q \(2, 1, 1\)"),
            ([], np.zeros((0, 1)), "time and q of rig 'hinge' are empty; expected one frame at least"),
            (
                [0.0, 0.5, 1.0],
                [[0.0], [math.nan], [math.inf]],
                r"q of frame 1 \(t = 0.5 s\) has nan for elbow: the run went astray",
            ),
            ([0.0, 0.0], [[0.0], [1.0]], "time does not increase"),
            ([0.0, math.nan], [[0.0], [1.0]], "time does not increase"),
            ([1.0, 0.5], [[0.0], [1.0]], "time does not increase"),
        ],
    )
    def test_arrays(self, tmp_path, time, q, message):
        with pytest.raises(ValueError, match=message):
            write_glb(hinge(), time, q, tmp_path / "bad.glb")
        assert not list(tmp_path.iterdir())

    def test_quaternions(self, tmp_path):
        rig = art.load("pendulum")
        with pytest.raises(ValueError, match="the quaternion of joint 'shoulder' has norm 2"):
            write_glb(rig, [0.0], 2.0 * rig.neutral()[None], tmp_path / "bad.glb")

    def test_single_precision_is_good_enough(self, tmp_path):
        rig = art.load("pendulum")
        q = (rig.random(0, 20) * (1.0 + 5e-5)).astype(np.float32)
        assert_same_motion(written(tmp_path, rig, q), rig, _unit(rig, q))

    def test_pygltflib_is_missing(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "pygltflib", None)
        with pytest.raises(ImportError, match=r"this needs pygltflib; install it with: pip install 'articulated\[gltf\]'"):
            written(tmp_path, hinge(), np.zeros((2, 1)))


def _unit(rig: art.Rig, q: np.ndarray) -> np.ndarray:
    q = q.astype(float)
    for where in rig.quaternions.values():
        q[:, where] /= np.linalg.norm(q[:, where], axis=-1, keepdims=True)
    return q


@pytest.fixture(scope="module")
def run() -> art.Trajectory:
    rig = art.load("pendulum")
    return art.Simulation(rig, dt=0.01).run(rig.random(0, (2,)), duration=0.2, fps=20)


class TestExport:
    def test_of_one_state(self, run, tmp_path):
        run.state(1).export(tmp_path / "fall.glb")
        glb = GlbFile(tmp_path / "fall.glb")
        assert glb.animation["name"] == "pendulum"
        assert_same_motion(glb, run.rig, run.q[1])

    def test_a_batch(self, run, tmp_path):
        with pytest.raises(
            ValueError, match=r"fall.glb: a batch \(2,\) is no one motion; write one of its states: run.state\(0\).export"
        ):
            run.export(tmp_path / "fall.glb")
        assert not list(tmp_path.iterdir())

    def test_a_motion(self, run, tmp_path):
        run.state(0).motion().export(tmp_path / "fall.glb", fps=10)
        glb = GlbFile(tmp_path / "fall.glb")
        assert {len(time) for time, _ in glb.channels.values()} == {3}

    def test_particles_are_left_out(self, tmp_path):
        rig = art.load("pendulum", "free")
        hair = ap.hair_on(next(iter(rig.links)), [(0, 0, 0)], (0, 0, 1), length=0.4, particles=4, mass=0.02, stiffness=1e3)
        run = art.Simulation(rig, dt=0.01, particles=hair).run(duration=0.02, fps=50)
        count = run.particles.x.shape[-2]
        with pytest.warns(
            art.RigWarning, match=rf"fall.glb: the {count} particles of this trajectory are left out; save's .npz"
        ):
            run.export(tmp_path / "fall.glb")
        assert (tmp_path / "fall.glb").exists()

    def test_a_full_disk_leaves_nothing(self, run, tmp_path, monkeypatch):
        def full(*_):
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(files.os, "fsync", full)
        with pytest.raises(OSError, match=r"cannot write .*fall.glb: No space left on device"):
            run.state(0).export(tmp_path / "fall.glb")
        assert not list(tmp_path.iterdir())
