"""BVH in and out: joints where pybvh has them, files written as they were read, and what is wrong with files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from bvh_files import CHAIN, COLLAR, COLLAR_ENDS, ENDS, MIXAMO, bvh_text, written

import articulated as art

pybvh = pytest.importorskip("pybvh")

CMU = Path(__file__).parents[1] / "data" / "cmu_12_01_walk_15fps.bvh"


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bvh")
    mixamo = written(folder, bvh_text(MIXAMO, ENDS), "mixamo.bvh")
    return {"cmu": CMU, "mixamo": mixamo, "collar": written(folder, bvh_text(COLLAR, COLLAR_ENDS, seed=1), "collar.bvh")}


@pytest.fixture(scope="module")
def clips(files) -> dict[str, tuple[art.Rig, art.Motion]]:
    return {name: art.from_bvh(path) for name, path in files.items()}


NAMES = ("cmu", "mixamo", "collar")


@pytest.mark.parametrize("name", NAMES)
class TestSkeletons:
    def test_joints_are_where_pybvh_has_them(self, files, clips, name):
        rig, motion = clips[name]
        clip = pybvh.read_bvh_file(files[name], world_up="+y")
        truth = clip.node_positions() @ motion.skeleton.turn.T * motion.skeleton.scale
        X = art.link_poses(rig, motion.q)
        size = np.ptp(truth, axis=(0, 1)).max()
        assert len(rig.links) == clip.joint_count
        for link in rig.links.values():
            assert np.abs(X[:, link.index, :3, 3] - truth[:, clip.node_index[link.name]]).max() < 1e-12 * size
        assert motion.fps == clip.fps

    def test_it_stands_upright_and_looks_along_x(self, clips, name):
        rig, _ = clips[name]
        X = art.link_poses(rig, rig.neutral())[:, :3, 3]
        place = {
            "head": ("Head", "mixamorig:Head", "head"),
            "left": ("LeftUpLeg", "mixamorig:LeftUpLeg", "lThigh"),
            "right": ("RightUpLeg", "mixamorig:RightUpLeg", "rThigh"),
        }
        at = {what: X[rig.links[names[NAMES.index(name)]].index] for what, names in place.items()}
        across, up = at["left"] - at["right"], at["head"] - 0.5 * (at["left"] + at["right"])
        assert up[2] > 0.9 * np.linalg.norm(up)
        forward = np.cross(across, up)
        assert abs(forward[2]) < 0.2 * np.linalg.norm(forward)
        if name != "collar":  # z up says nothing of forward; see `up`
            assert forward[0] > 0.9 * np.linalg.norm(forward)

    def test_written_and_read_again(self, files, clips, name, tmp_path):
        _, motion = clips[name]
        motion.export(tmp_path / "again.bvh")
        one = pybvh.read_bvh_file(files[name], world_up="+y")
        two = pybvh.read_bvh_file(tmp_path / "again.bvh", world_up="+y")
        assert two.matches_topology(one)
        assert two.frame_time == pytest.approx(one.frame_time, rel=1e-9)
        np.testing.assert_allclose(two.root_pos, one.root_pos, atol=1.1e-6)
        np.testing.assert_allclose(np.degrees(two.joint_angles), np.degrees(one.joint_angles), atol=1.1e-6)

    def test_masses(self, clips, name):
        rig, _ = clips[name]
        assert rig.mass == pytest.approx(70.0, rel=1e-12)
        for ends, part in ((("upleg", "thigh"), 0.1416), (("forearm",), 0.0162)):
            both = sum(link.mass for name, link in rig.links.items() if name.lower().endswith(ends))
            assert both == pytest.approx(2.0 * part * 70.0, rel=1e-3)
        for body in rig.bodies:
            assert body.mass > 0.0
            assert np.linalg.eigvalsh(body.inertia)[0] > 0.0

    def test_the_clip_is_within_its_limits(self, clips, name):
        rig, motion = clips[name]
        found = art.audit(motion)
        assert found.violations == {}
        assert all(joint.limits.ball is not None for joint in rig.joints.values() if joint.kind == "ball")

    def test_neighbours_do_not_collide(self, clips, name):
        rig, _ = clips[name]
        disabled = {frozenset(pair) for pair in rig.disabled_collisions}
        for joint in rig.joints.values():
            assert not joint.parent or frozenset((joint.parent, joint.child)) in disabled


class TestUnits:
    def test_a_guess_is_said(self, files):
        with pytest.warns(art.RigWarning, match=r"taken as the unit of CMU's database: 1\.\d\d m"):
            art.from_bvh(files["cmu"], limits=None)
        with pytest.warns(art.RigWarning, match=r"taken as centimetres: 1\.\d\d m"):
            art.from_bvh(files["mixamo"], limits=None)
        with pytest.warns(art.RigWarning, match=r"taken as inches"):
            art.from_bvh(files["collar"], limits=None)

    def test_a_scale_is_taken(self, files, recwarn):
        _, motion = art.from_bvh(files["mixamo"], scale=0.02)
        assert motion.skeleton.scale == 0.02
        assert not [w for w in recwarn.list if "taken as" in str(w.message)]

    def test_axes_are_taken(self, tmp_path):
        path = written(tmp_path, CHAIN)
        rig, motion = art.from_bvh(path, scale=0.01, up="z")
        np.testing.assert_allclose(art.link_poses(rig, motion.q)[:, 0, :3, 3], [[0, 0.9, 0], [0, 0.9, 0.01], [0, 0.9, 0.02]])

    @pytest.mark.parametrize(
        ("given", "match"),
        [
            ({"scale": -1.0}, "scale is -1.0"),
            ({"scale": "cm"}, "scale is 'cm'"),
            ({"up": "w"}, "up is 'w'"),
            ({"mass": 0.0}, "mass is 0.0"),
            ({"sex": "cat"}, "sex is 'cat'"),
            ({"limits": "some"}, "limits is 'some'"),
            ({"root": "planar?"}, "root is 'planar\\?'"),
        ],
    )
    def test_arguments(self, tmp_path, given, match):
        with pytest.raises(ValueError, match=match):
            art.from_bvh(written(tmp_path, CHAIN), **{"scale": 0.01, **given})


BAD = {
    "not a BVH": ("solid cube\n", r"clip.bvh: does not begin with HIERARCHY; give a BVH file"),
    "empty": ("", "does not begin with HIERARCHY"),
    "no hierarchy": ("HIERARCHY\nMOTION\nFrames: 1\nFrame Time: 0.1\n", r":2: the hierarchy is empty; it needs a ROOT"),
    "no MOTION": (CHAIN[: CHAIN.index("MOTION")], r":15: the file ends where the MOTION section should follow"),
    "cut in the hierarchy": (CHAIN[:120], r"the file ends where the rest of the hierarchy should follow"),
    "cut in the frames": (CHAIN.rsplit("\n", 2)[0] + "\n", r":20: there are 2 frames; 'Frames:' says 3"),
    "cut in a frame": (CHAIN[:-6], r":21: frame 2: has 7 values; the hierarchy has 9 channels"),
    "too many values": (CHAIN.replace("0 90 1 0", "0 90 1 0 0"), r":20: frame 1: has 10 values"),
    "no numbers": (
        CHAIN.replace("0 90 1", "0 90 one"),
        r":20: frame 1: could not convert string to float: 'one'; give numbers",
    ),
    "negative frame time": (CHAIN.replace("0.0333333", "-0.03"), r":18: frame time is -0.03; give a positive number"),
    "frame time zero": (CHAIN.replace("0.0333333", "0"), "frame time is 0"),
    "no frame time": (CHAIN.replace("Frame Time: 0.0333333", "Rate: 30"), r":18: 'Rate: 30' is not 'Frame Time: s'"),
    "no count": (CHAIN.replace("Frames: 3", "Frames: three"), r":17: 'Frames: three' is not 'Frames: N'"),
    "no frames": (CHAIN[: CHAIN.index("0 90")].replace("Frames: 3", "Frames: 0"), r":17: there are no frames"),
    "one frame": (
        "\n".join(CHAIN.split("\n")[:19]).replace("Frames: 3", "Frames: 1"),
        "there is one frame; a motion takes two",
    ),
    "same names": (CHAIN.replace("Spine", "Hips"), r":6: joint 'Hips': another joint, of line 2, has this name; rename one"),
    "no name": (CHAIN.replace("JOINT Spine", "JOINT"), r":6: JOINT has no name"),
    "second root": (CHAIN.replace("JOINT Spine", "ROOT Spine"), r":6: joint 'Spine': a second ROOT"),
    "unknown channel": (CHAIN.replace("3 Zrotation", "3 Wrotation"), r":9: joint 'Spine': unknown channel 'Wrotation'"),
    "channels twice": (CHAIN.replace("3 Zrotation", "3 Xrotation"), "CHANNELS names one twice"),
    "channel count": (CHAIN.replace("CHANNELS 3", "CHANNELS 4"), r":9: joint 'Spine': CHANNELS says 4 and names 3"),
    "channels of an end": (CHAIN.replace("OFFSET 0 40 0", "CHANNELS 0"), "end site of 'Spine': an end site has CHANNELS"),
    "offset": (CHAIN.replace("OFFSET 0 50 0", "OFFSET 0 50"), r":8: joint 'Spine': OFFSET is 0 50; give three finite numbers"),
    "offset NaN": (CHAIN.replace("OFFSET 0 50 0", "OFFSET 0 nan 0"), "OFFSET is 0 nan 0"),
    "no offset": (CHAIN.replace("    OFFSET 0 50 0\n", ""), r":6: joint 'Spine': has no OFFSET"),
    "open": (CHAIN.replace("}\nMOTION", "MOTION"), r"joint 'Hips': MOTION comes before the last '}'; close every joint"),
    "closed twice": (CHAIN.replace("}\nMOTION", "}\n}\nMOTION"), r"'}' closes nothing"),
    "outside": (CHAIN.replace("ROOT Hips", "JOINT Hips"), r":2: joint 'Hips': JOINT stands outside of the ROOT"),
    "stray word": (CHAIN.replace("OFFSET 0 50 0", "SCALE 1"), "'SCALE 1' has no meaning here"),
    "gap": (CHAIN.replace("0 90 1 0 5", "0 90 1 0 nan"), r":20: frame 1: 'Hips' Xrotation is nan; mend it, or fill"),
    "sliding bone": (
        CHAIN.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
        .replace("0 90 0 0 0 0 ", "0 90 0 0 0 0 0 50 0 ")
        .replace("10 0 0\n", "0 50 0 10 0 0\n")
        .replace("20 0 0\n", "0 50 9 20 0 0\n"),
        r":6: joint 'Spine': slides by .* only the root may",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    text, match = BAD[name]
    with pytest.raises(art.RigError, match=match):
        art.from_bvh(written(tmp_path, text), scale=0.01)


def test_no_such_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        art.from_bvh(tmp_path / "none.bvh")


def test_all_at_one_place(tmp_path):
    with pytest.raises(ValueError, match="give scale"):
        art.from_bvh(written(tmp_path, re.sub("OFFSET .*", "OFFSET 0 0 0", CHAIN)), up="y")


class TestUnusualFiles:
    """What some readers refuse, and what means the same as the usual form."""

    def same(self, tmp_path, text: str, **options) -> None:
        rig, one = art.from_bvh(written(tmp_path, CHAIN), scale=0.01, up="y")
        other_rig, other = art.from_bvh(written(tmp_path, text, "other.bvh"), scale=0.01, up="y", **options)
        assert list(rig.links) == [name.replace("Lower_", "") for name in other_rig.links]
        np.testing.assert_allclose(other.q, one.q, atol=1e-12)

    def test_braces_on_the_line_of_the_name_and_blanks(self, tmp_path):
        self.same(tmp_path, CHAIN.replace("JOINT Spine\n  {", "JOINT Lower Spine {").replace("\n", "\r\n\r\n"))

    def test_turns_before_positions(self, tmp_path):
        text = CHAIN.replace(
            "Xposition Yposition Zposition Zrotation Xrotation Yrotation",
            "Zrotation Xrotation Yrotation Zposition Xposition Yposition",
        )
        for before, after in (
            ("0 90 0 0 0 0", "0 0 0 0 0 90"),
            ("0 90 1 0 5 0", "0 5 0 1 0 90"),
            ("0 90 2 0 9 0", "0 9 0 2 0 90"),
        ):
            text = text.replace(before, after)
        self.same(tmp_path, text)

    def test_fewer_turns(self, tmp_path):
        text = CHAIN.replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 1 Zrotation")
        self.same(tmp_path, re.sub(r"^(0 90 .*) 0 0$", r"\1", text, flags=re.MULTILINE))

    def test_positions_that_are_the_offset(self, tmp_path):
        text = CHAIN.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
        self.same(tmp_path, re.sub(r"^(0 90 \d \d \d \d) ", r"\1 0 50 0 ", text, flags=re.MULTILINE))
        self.same(tmp_path, re.sub(r"^(0 90 \d \d \d \d) ", r"\1 0 0 0 ", text, flags=re.MULTILINE))
        moved = re.sub(r"^(0 90 \d \d \d \d) ", r"\1 0 60 0 ", text, flags=re.MULTILINE)
        with pytest.warns(
            art.RigWarning, match=r"position channels hold \[0.0, 60.0, 0.0\], not its OFFSET; they take its place"
        ):
            self.same(tmp_path, moved)

    def test_bones_of_no_length_are_told(self, tmp_path):
        with pytest.warns(art.RigWarning, match="bones of no length: Spine"):
            rig, _ = art.from_bvh(written(tmp_path, CHAIN.replace("OFFSET 0 40 0", "OFFSET 0 0 0")), scale=0.01, up="y")
        assert rig.bodies[1].mass > 0.0


class TestGaps:
    def test_they_are_filled_the_shortest_way(self, tmp_path):
        text = CHAIN.replace("0 90 1 0 5 0 10 0 0", "0 90 nan 0 5 0 nan 0 0")
        with pytest.warns(art.RigWarning, match="frame 1 held numbers that are not finite; filled from those before and after"):
            rig, motion = art.from_bvh(written(tmp_path, text), scale=0.01, up="y", repair=True)
        middle = art.integrate(rig, motion.q[0], 0.5 * art.difference(rig, motion.q[0], motion.q[2]))
        np.testing.assert_allclose(motion.q[1][3:], middle[3:], atol=1e-9)
        assert motion.q[1, 0] == pytest.approx(0.01)

    def test_the_way_across_180_degrees_is_short(self, tmp_path):
        text = CHAIN.replace(" 10 0 0\n", " nan 0 0\n").replace(" 0 0 0\n", " 170 0 0\n").replace(" 20 0 0\n", " -170 0 0\n")
        _, motion = art.from_bvh(written(tmp_path, text), scale=0.01, up="y", repair=True, limits=None)
        turns = 2.0 * np.arccos(np.abs(motion.q[:, -1]))
        np.testing.assert_allclose(np.degrees(turns), [170.0, 180.0, 170.0], atol=1e-5)

    def test_not_all_can_be_filled(self, tmp_path):
        text = CHAIN.replace("0 90", "nan 90", 2).replace("OFFSET 0 nan", "OFFSET 0 90")
        with pytest.raises(art.RigError, match="2 of 3 frames are gaps; two whole frames are needed"):
            art.from_bvh(written(tmp_path, text), scale=0.01, repair=True)


class TestOut:
    def test_any_rig(self, tmp_path):
        rig = art.load("ragdoll", "free")
        rng = np.random.default_rng(0)
        q = art.integrate(rig, rig.neutral(), np.cumsum(0.05 * rng.normal(size=(20, rig.nv)), axis=0))
        motion = art.Motion(rig, q, 30.0)
        motion.export(tmp_path / "ragdoll.bvh")
        again_rig, again = art.from_bvh(tmp_path / "ragdoll.bvh", scale=0.01, up="y", limits=None)
        X, Y = art.link_poses(rig, motion.q), art.link_poses(again_rig, again.q)
        for link in again_rig.links.values():
            np.testing.assert_allclose(Y[:, link.index, :3, 3], X[:, rig.links[link.name].index, :3, 3], atol=1e-6)

    def test_what_cannot_be_written(self, tmp_path):
        rig = art.load("cartpole")
        motion = art.Motion(rig, np.zeros((3, rig.nq)), 30.0)
        with pytest.raises(ValueError, match="slide, which BVH does not know"):
            motion.export(tmp_path / "cart.bvh")
        assert not list(tmp_path.iterdir())
