"""BVH files: positions of joints as pybvh has them, written as they were read, from other tools' skeletons; and bad files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pybvh
import pytest

import articulated as art
from articulated.characters.names import segments_of, side

WALK = Path(__file__).parents[1] / "data" / "cmu_12_01_walk.bvh"

MIXAMO = {
    "Hips": ("", (0, 100, 0)),
    "Spine": ("Hips", (0, 10, 0)),
    "Spine1": ("Spine", (0, 12, 0)),
    "Spine2": ("Spine1", (0, 13, 0)),
    "Neck": ("Spine2", (0, 15, 0)),
    "Head": ("Neck", (0, 10, 2)),
    "LeftShoulder": ("Spine2", (6, 12, 0)),
    "LeftArm": ("LeftShoulder", (12, 0, 0)),
    "LeftForeArm": ("LeftArm", (27, 0, 0)),
    "LeftHand": ("LeftForeArm", (26, 0, 0)),
    "RightShoulder": ("Spine2", (-6, 12, 0)),
    "RightArm": ("RightShoulder", (-12, 0, 0)),
    "RightForeArm": ("RightArm", (-27, 0, 0)),
    "RightHand": ("RightForeArm", (-26, 0, 0)),
    "LeftUpLeg": ("Hips", (9, -5, 0)),
    "LeftLeg": ("LeftUpLeg", (0, -44, 0)),
    "LeftFoot": ("LeftLeg", (0, -42, 0)),
    "LeftToeBase": ("LeftFoot", (0, -9, 14)),
    "RightUpLeg": ("Hips", (-9, -5, 0)),
    "RightLeg": ("RightUpLeg", (0, -44, 0)),
    "RightFoot": ("RightLeg", (0, -42, 0)),
    "RightToeBase": ("RightFoot", (0, -9, 14)),
}
COLLARS = {
    "hip": ("", (0, 40, 0)),
    "abdomen": ("hip", (0, 4, 0)),
    "chest": ("abdomen", (0, 8, 0)),
    "neck": ("chest", (0, 9, 0)),
    "head": ("neck", (0, 3, 0)),
    **{
        f"{s}{name}": (f"{s}{parent}" if parent[0].isupper() else parent, (sign * x, y, z))
        for s, sign in (("l", 1), ("r", -1))
        for name, parent, (x, y, z) in (
            ("Collar", "chest", (1, 7, 0)),
            ("Shldr", "Collar", (6, 0, 0)),
            ("ForeArm", "Shldr", (11, 0, 0)),
            ("Hand", "ForeArm", (10, 0, 0)),
            ("Thigh", "hip", (4, -2, 0)),
            ("Shin", "Thigh", (0, -17, 0)),
            ("Foot", "Shin", (0, -17, 0)),
        )
    },
}


def written(path: Path, bones: dict, orders: list[str], prefix: str = "", frames: int = 12, tail: str = "") -> Path:
    """A file of some bones; each joint turns in the next of some orders."""
    rng, names = np.random.default_rng(0), list(bones)
    lines = ["HIERARCHY"]

    def block(name: str, depth: int) -> None:
        parent, offset = bones[name]
        pad = "\t" * depth
        order = orders[names.index(name) % len(orders)]
        turns = " ".join(f"{axis}rotation" for axis in order)
        channels = f"6 Xposition Yposition Zposition {turns}" if not parent else f"3 {turns}"
        lines.extend([f"{pad}{'JOINT' if parent else 'ROOT'} {prefix}{name}", pad + "{"])
        lines.append(f"{pad}\tOFFSET {' '.join(map(str, offset))}")
        lines.append(f"{pad}\tCHANNELS {channels}")
        children = [child for child in names if bones[child][0] == name]
        for child in children:
            block(child, depth + 1)
        if not children:
            lines.extend([f"{pad}\tEnd Site", pad + "\t{", f"{pad}\t\tOFFSET 0 2 4", pad + "\t}"])
        lines.append(pad + "}")

    block(names[0], 0)
    depth_first = [line.split()[-1].removeprefix(prefix) for line in lines if line.split()[0] in ("ROOT", "JOINT")]
    turns = np.cumsum(rng.normal(size=(frames, 3 * len(depth_first))) * 6.0, axis=0)
    places = np.cumsum(rng.normal(size=(frames, 3)), axis=0) + bones[names[0]][1]
    lines += ["MOTION", f"Frames: {frames}", "Frame Time: 0.0333333"]
    lines += [" ".join(f"{x:.6f}" for x in row) for row in np.hstack([places, turns])]
    path.write_text("\n".join(lines) + "\n" + tail)
    return path


def quietly(path: Path, **options) -> tuple[art.Rig, art.Motion]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", art.RigWarning)
        return art.from_bvh(path, **options)


def farthest(path: Path, rig: art.Rig, motion: art.Motion) -> float:
    """How far joints are from where pybvh has them, in the file's unit."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = pybvh.read_bvh_file(path)
    X, places = art.link_poses(rig, motion.q)[..., :3, 3], file.node_positions()
    of = {node.name: k for k, node in enumerate(file.nodes)}
    assert set(rig.links) == set(file.joint_names)
    ours = X / motion.skeleton.scale @ motion.skeleton.turn
    return max(float(np.abs(ours[:, link.index] - places[:, of[link.name]]).max()) for link in rig.links.values())


@pytest.fixture(scope="module")
def walk() -> tuple[art.Rig, art.Motion]:
    return quietly(WALK)


class TestWalk:
    def test_joints_are_where_they_were(self, walk):
        assert farthest(WALK, *walk) < 1e-6

    def test_written_and_read_back(self, walk, tmp_path):
        rig, motion = walk
        motion.export(tmp_path / "again.bvh")
        assert farthest(tmp_path / "again.bvh", rig, motion) < 2e-6
        a, b = (pybvh.read_bvh_file(path) for path in (WALK, tmp_path / "again.bvh"))
        assert a.matches_hierarchy(b)
        assert a.euler_orders == b.euler_orders
        np.testing.assert_allclose(b.root_pos, a.root_pos, atol=2e-6)
        turns = 1.0 - np.abs(np.sum(a.to_quat()[1] * b.to_quat()[1], axis=-1))
        assert turns.max() < 1e-12
        assert b.frame_time == pytest.approx(a.frame_time, rel=1e-9)

    def test_a_person(self, walk):
        rig, motion = walk
        assert rig.mass == pytest.approx(70.0)
        assert motion.fps == pytest.approx(30.0)
        assert 0.7 < motion.q[:, 2].mean() < 1.1  # the hips
        legs = sum(link.mass for name, link in rig.links.items() if "Leg" in name and "Up" not in name)
        assert legs == pytest.approx(2 * 0.0433 * 70.0, rel=0.01)
        widths = [shape.geometry.radius for link in rig.links.values() for shape in link.collisions]
        assert min(widths) > 0.01
        assert max(widths) < 0.15
        assert set(rig.fixed_joints) == {"LHipJoint", "RHipJoint", "LeftShoulder", "RightShoulder"}

    def test_limits_hold_the_clip(self, walk):
        assert art.audit(walk[1]).violations == {}
        free, _ = quietly(WALK, limits=None)
        assert all(joint.limits == art.Limits() for joint in free.joints.values())

    def test_what_is_guessed_is_said(self):
        with pytest.warns(art.RigWarning) as said:
            art.from_bvh(WALK)
        text = " ".join(str(one.message) for one in said)
        assert "units tall, taken as the unit of CMU's database" in text
        assert "bones of no length: Hips, Spine1, LeftHand, RightHand" in text
        assert "joints that never turn: LHipJoint, RHipJoint, LeftShoulder, RightShoulder; they are fixed" in text
        with pytest.warns(art.RigWarning) as said:
            art.from_bvh(WALK, scale=0.05)
        assert not any("tall" in str(one.message) for one in said)

    def test_the_figure_at_rest_is_found(self, walk):
        jumps = art.audit(walk[1]).jumps
        assert {jump.time for jump in jumps} <= {0.0}
        assert "LeftArm" in {jump.joint for jump in jumps}
        clean = walk[1].part(0.02)
        assert art.audit(clean).jumps == ()


class TestOtherTools:
    @pytest.mark.parametrize("order", ["XYZ", "ZXY", "YXZ", "ZYX", "XZY", "YZX"])
    def test_mixamo(self, tmp_path, order):
        path = written(tmp_path / "mixamo.bvh", MIXAMO, [order], "mixamorig:")
        rig, motion = quietly(path)
        assert farthest(path, rig, motion) < 1e-6
        assert motion.skeleton.scale == 0.01
        motion.export(tmp_path / "again.bvh")
        assert farthest(tmp_path / "again.bvh", rig, motion) < 2e-6
        assert rig.links["mixamorig:LeftUpLeg"].mass == pytest.approx(0.1416 * 70.0, rel=0.01)

    def test_collars_and_mixed_orders(self, tmp_path):
        path = written(tmp_path / "collars.bvh", COLLARS, ["XYZ", "ZXY", "YXZ"])
        rig, motion = quietly(path)
        assert farthest(path, rig, motion) < 1e-6
        assert motion.skeleton.scale == 0.0254
        assert rig.links["lShldr"].mass == pytest.approx(0.0271 * 70.0, rel=0.01)

    def test_z_up(self, tmp_path):
        bones = {name: (parent, (z, x, y)) for name, (parent, (x, y, z)) in MIXAMO.items()}
        path = written(tmp_path / "up.bvh", bones, ["ZXY"])
        rig, motion = quietly(path, up="z")
        assert farthest(path, rig, motion) < 1e-6
        X = art.link_poses(rig, rig.neutral())
        assert X[rig.links["Head"].index, 2, 3] > 0.4

    def test_names(self):
        assert segments_of(["LeftHip", "LeftKnee", "LeftAnkle", "LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist", "Hips"]) == [
            "thigh", "shank", "foot", "upper_trunk", "upper_arm", "forearm", "hand", "lower_trunk"]  # fmt: skip
        assert segments_of(["thigh.L", "shin.L", "foot.L", "upper_arm.L", "spine", "tentacle"]) == [
            "thigh", "shank", "foot", "upper_arm", "middle_trunk", ""]  # fmt: skip
        assert [side(name) for name in ("mixamorig:LeftArm", "thigh.R", "lShldr", "r_hand", "Lumbar", "Hips", "head")] == [
            "left", "right", "left", "right", "", "", ""]  # fmt: skip

    def test_a_creature_of_no_known_bones(self, tmp_path):
        bones = {f"b{k}": (f"b{k - 1}" if k else "", (0, 20, 3)) for k in range(9)}
        path = written(tmp_path / "worm.bvh", bones, ["ZXY"])
        rig, motion = quietly(path, scale=0.01, mass=5.0)
        assert rig.mass == pytest.approx(5.0)
        assert farthest(path, rig, motion) < 1e-6

    def test_any_rig_can_be_written(self, tmp_path):
        rig = art.load("ragdoll", root="free")
        q = rig.random(0, 5)
        art.Motion(rig, q, 30.0).export(tmp_path / "ragdoll.bvh")
        again, motion = quietly(tmp_path / "ragdoll.bvh", scale=0.01)
        X, Y = art.link_poses(rig, q), art.link_poses(again, motion.q)
        for body in rig.bodies:
            ours, theirs = X[:, rig.links[body.name].index, :3, 3], Y[:, again.links[body.name].index, :3, 3]
            np.testing.assert_allclose(theirs, ours, atol=1e-6)
        slider = art.load("cartpole")
        with pytest.raises(ValueError, match="joints slide slide, which BVH does not know"):
            art.Motion(slider, slider.random(0, 3), 30.0).export(tmp_path / "x.bvh")


class TestBadFiles:
    @pytest.fixture
    def text(self) -> str:
        return WALK.read_text()

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (
                lambda s: s[: len(s) // 2],
                r"bad\.bvh:\d+: frame \d+: has \d+ values; the hierarchy has 96 channels; it was cut off",
            ),
            (lambda s: "HIERARCHY\n", r"bad\.bvh:1: the file ends where the rest of the hierarchy should follow"),
            (lambda s: "solid noise", "does not begin with HIERARCHY; give a BVH file"),
            (lambda s: "", "does not begin with HIERARCHY; give a BVH file"),
            (lambda s: s[: s.index("MOTION")], "the file ends where the MOTION section should follow"),
            (
                lambda s: s.replace("Frame Time: 0.03333333333", "Frame Time: -1"),
                r"bad\.bvh:\d+: frame time is -1; give a positive number of seconds",
            ),
            (
                lambda s: s.replace("JOINT Neck1", "JOINT Neck"),
                "joint 'Neck': another joint, of line 76, has this name; rename one",
            ),
            (lambda s: s.replace("Zrotation", "Wrotation", 1), "joint 'Hips': unknown channel 'Wrotation'"),
            (
                lambda s: s.replace("OFFSET 0.000000", "OFFSET nan", 1),
                "joint 'Hips': OFFSET is nan .*; give three finite numbers",
            ),
            (lambda s: s + "1 2 3\n", "frame 131: has 3 values; the hierarchy has 96 channels"),
        ],
    )
    def test_refused(self, text, tmp_path, change, message):
        (tmp_path / "bad.bvh").write_text(change(text))
        with pytest.raises(art.RigError, match=message):
            quietly(tmp_path / "bad.bvh")

    def test_gaps(self, tmp_path):
        path = written(tmp_path / "gap.bvh", MIXAMO, ["ZXY"], frames=20)
        whole = quietly(path)[1]
        lines = path.read_text().splitlines()
        for k in (-8, -7):
            lines[k] = " ".join(["nan"] * len(lines[k].split()))
        path.write_text("\n".join(lines) + "\n")
        with pytest.raises(
            art.RigError, match=r"gap\.bvh:\d+: frame 12: 'Hips' Xposition is nan; mend it, or fill such gaps with repair=True"
        ):
            quietly(path)
        with pytest.warns(
            art.RigWarning, match="frames 12-13 held numbers that are not finite; filled from those before and after"
        ):
            rig, motion = art.from_bvh(path, repair=True)
        moved = np.abs(art.difference(rig, whole.q, motion.q)).max(axis=-1)
        assert np.flatnonzero(moved > 1e-9).tolist() == [12, 13]
        assert moved.max() < 1.0

    def test_arguments(self, tmp_path):
        for options, message in (
            ({"scale": 0.0}, "scale is 0.0; expected metres in a unit of the file"),
            ({"scale": "big"}, "scale is 'big'"),
            ({"up": "w"}, "up is 'w'; expected 'auto', 'x', 'y' or 'z'"),
            ({"mass": -1.0}, "mass is -1.0; expected a positive number of kilograms"),
            ({"limits": "all"}, "limits is 'all'; expected 'clip' or None"),
            ({"sex": "x"}, "sex is 'x'"),
        ):
            with pytest.raises(ValueError, match=message):
                quietly(WALK, **options)
        with pytest.raises(FileNotFoundError, match="no such file; give the path of a BVH file"):
            art.from_bvh(tmp_path / "none.bvh")
        tiny = {name: (parent, tuple(1e-3 * x for x in offset)) for name, (parent, offset) in MIXAMO.items()}
        path = written(tmp_path / "tiny.bvh", tiny, ["ZXY"])
        path.write_text(path.read_text().replace("OFFSET 0 2 4", "OFFSET 0 0 0"))
        with pytest.raises(art.RigError, match="in no usual unit that of a person; give scale"):
            quietly(path)

    def test_one_frame(self, tmp_path):
        with pytest.raises(art.RigError, match="there is one frame; a motion takes two at least"):
            quietly(written(tmp_path / "one.bvh", MIXAMO, ["ZXY"], frames=1))

    def test_without_pybvh(self, monkeypatch):
        import sys

        monkeypatch.setitem(sys.modules, "pybvh", None)
        with pytest.raises(ImportError, match=r"this needs pybvh; install it with: pip install 'articulated\[mocap\]'"):
            art.from_bvh(WALK)
