"""A walk by other figures: parts turn as the source's do, hands and feet go where they should, limits and the ground hold."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from bvh_files import ENDS, MIXAMO, bvh_text, written

import articulated as art
from articulated.characters.ground import lowest
from articulated.characters.parts import roles

pytest.importorskip("pybvh")

FEET = ("left_foot", "right_foot")


def quietly(function, *arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", art.RigWarning)
        return function(*arguments, **options)


@pytest.fixture(scope="module")
def ragdoll() -> art.Rig:
    return art.load("ragdoll", "free")


@pytest.fixture(scope="module")
def dance(ragdoll) -> art.Motion:
    """The ragdoll moves all joints, within limits."""
    rig, t = ragdoll, np.arange(20)[:, None] / 20.0
    rng = np.random.default_rng(2)
    dv = 0.35 * np.sin(2.0 * t * rng.uniform(1, 2, rig.nv) + rng.uniform(0, 6, rig.nv))
    dv[:, 2] += 1.0
    q = art.integrate(rig, rig.neutral(), dv)
    for joint in rig.joints.values():
        if joint.nq <= 2:
            q[:, joint.q_slice] = np.clip(q[:, joint.q_slice], joint.limits.lower, joint.limits.upper)
    return art.Motion(rig, q, 20.0)


def test_onto_itself_it_is_the_same(ragdoll, dance):
    again = art.retarget(dance, ragdoll)
    assert np.abs(art.difference(ragdoll, dance.q, again.q)).max() < 1e-3
    assert again.fps == dance.fps


def test_a_taller_person_turns_joints_alike_and_goes_farther():
    small, tall = art.person(1.5, 50.0), art.person(1.9, 90.0)
    t = np.arange(10)[:, None] / 10.0
    dv = 0.2 * np.sin(2.0 * t + np.linspace(0.0, 6.0, small.nv)) + 0.2
    dv[:, :3] += 2.0 * t
    q = small.neutral() + np.zeros((10, 1))
    one = art.Motion(small, art.integrate(small, q, dv), 10.0)
    two = art.retarget(one, tall)
    away = np.abs(art.difference(small, one.q, two.q))[:, 6:]
    within = np.ones(small.nv - 6, dtype=bool)
    for joint in small.joints.values():  # hinges that the first turns beyond their limits
        if joint.nq <= 2:
            own = one.q[:, joint.q_slice]
            within[joint.v_slice.start - 6 : joint.v_slice.stop - 6] = bool(
                ((own > joint.limits.lower) & (own < joint.limits.upper)).all()
            )
    assert within.sum() > 30
    assert away[:, within].max() < 0.02
    walked = [np.ptp(motion.q[:, :2], axis=0) for motion in (one, two)]
    np.testing.assert_allclose(walked[1] / walked[0], 1.9 / 1.5, rtol=1e-6)


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> tuple[art.Rig, art.Motion]:
    return quietly(art.from_bvh, written(tmp_path_factory.mktemp("clip"), bvh_text(MIXAMO, ENDS)), scale=0.01)


@pytest.fixture(scope="module")
def moved(clip, ragdoll) -> art.Motion:
    return quietly(art.retarget, clip[1], ragdoll)


class TestMixamo:
    def test_trunk_turns_as_it_did(self, clip, ragdoll, moved):
        X, Y = art.link_poses(clip[0], clip[1].q), art.link_poses(ragdoll, moved.q)
        one = X[:, clip[0].links["mixamorig:Hips"].index, :3, :3]
        rest = art.link_poses(ragdoll, ragdoll.neutral())[ragdoll.links["pelvis"].index, :3, :3]
        np.testing.assert_allclose(Y[:, ragdoll.links["pelvis"].index, :3, :3], one @ rest, atol=1e-9)

    def test_bones_point_as_they_did(self, clip, ragdoll, moved):
        X, Y = art.link_poses(clip[0], clip[1].q)[..., :3, 3], art.link_poses(ragdoll, moved.q)[..., :3, 3]

        def along(places, rig, a, b):
            d = places[:, rig.links[b].index] - places[:, rig.links[a].index]
            return d / np.linalg.norm(d, axis=-1, keepdims=True)

        one = along(X, clip[0], "mixamorig:LeftUpLeg", "mixamorig:LeftLeg")
        two = along(Y, ragdoll, "left_thigh", "left_shin")
        assert (
            np.degrees(np.arccos(np.clip((one * two).sum(axis=-1), -1, 1))).mean() < 20.0
        )  # knees are hinges there, and bend one way

    def test_another_rest_pose(self, ragdoll, tmp_path):
        """Arms that hang at rest hang, though the other's rest is with arms stretched out."""
        hanging = MIXAMO.replace("LeftArm 27 0 0", "LeftArm 0 -27 0").replace("LeftForeArm 26 0 0", "LeftForeArm 0 -26 0")
        text = bvh_text(hanging, {**ENDS, "LeftHand": "0 -15 0"})
        head, frames = text.split("Frame Time")
        still = "\n".join("0 95 0" + " 0" * 66 for _ in range(12))
        path = written(tmp_path, f"{head}Frame Time{frames.split(chr(10))[0]}\n{still}\n")
        q = quietly(art.retarget, quietly(art.from_bvh, path, scale=0.01)[1], ragdoll).q
        X = art.link_poses(ragdoll, q)[0, :, :3, 3]
        arm = X[ragdoll.links["left_forearm"].index] - X[ragdoll.links["left_upper_arm"].index]
        assert arm[2] < -0.99 * np.linalg.norm(arm)

    def test_limits_of_hinges_hold(self, ragdoll, moved):
        for joint in ragdoll.joints.values():
            if joint.nq <= 2:
                own = moved.q[:, joint.q_slice]
                assert (own >= joint.limits.lower - 1e-12).all()
                assert (own <= joint.limits.upper + 1e-12).all()

    def test_the_lowest_foot_is_as_low(self, clip, ragdoll, moved):
        low = lowest(ragdoll, moved.q)[:, [ragdoll.links[name].index for name in FEET]].min()
        feet = [link.index for name, link in clip[0].links.items() if "Foot" in name or "Toe" in name]
        assert low == pytest.approx(lowest(clip[0], clip[1].q)[:, feet].min(), abs=1e-9)

    def test_names_given(self, clip, ragdoll):
        names = {"pelvis": "mixamorig:Hips", "torso": "mixamorig:Spine2", "head": "mixamorig:Head"}
        moved = quietly(art.retarget, clip[1], ragdoll, names)
        arm = ragdoll.joints["left_elbow"].q_slice
        np.testing.assert_allclose(moved.q[:, arm], 0.0, atol=1e-9)

    def test_errors(self, clip, ragdoll, dance):
        with pytest.raises(ValueError, match="rig 'ragdoll' has no link 'pelvs'; did you mean 'pelvis'"):
            art.retarget(clip[1], ragdoll, {"pelvs": "mixamorig:Hips"})
        with pytest.raises(ValueError, match="rig 'clip' has no link 'Hips'"):
            art.retarget(clip[1], ragdoll, {"pelvis": "Hips"})
        with pytest.raises(ValueError, match="names is 'guess'; expected 'auto'"):
            art.retarget(dance, ragdoll, "guess")
        with pytest.raises(ValueError, match="have 0 parts in common; give names"):
            art.retarget(dance, art.load("pendulum"))


def test_out_of_reach_is_told(ragdoll):
    builder = art.RigBuilder("stiff")
    for name in ("pelvis", "torso", "head", "left_upper_arm", "left_forearm", "left_hand"):
        builder.link(name, 1.0, inertia=(0.01, 0.01, 0.01))
    builder.joint("waist", "ball", "pelvis", "torso", xyz=(0, 0, 0.3))
    builder.joint("neck", "ball", "torso", "head", xyz=(0, 0, 0.4))
    builder.joint("shoulder", "revolute", "torso", "left_upper_arm", xyz=(0, 0.2, 0.3), limits=art.Limits(0.0, 0.1))
    builder.joint("elbow", "revolute", "left_upper_arm", "left_forearm", xyz=(0, 0.3, 0), limits=art.Limits(0.0, 0.1))
    builder.joint("wrist", "revolute", "left_forearm", "left_hand", xyz=(0, 0.3, 0), limits=art.Limits(0.0, 0.1))
    q = np.tile(ragdoll.neutral(), (4, 1))
    dv = np.zeros((4, ragdoll.nv))
    dv[:, ragdoll.joints["left_shoulder"].v_slice] = [1.5, 0.0, 0.0]
    with pytest.warns(art.RigWarning, match=r"link 'left_hand': is .* m from its place in frame \d.*it cannot reach it"):
        art.retarget(art.Motion(ragdoll, art.integrate(ragdoll, q, dv), 30.0), builder.build("free"))


@pytest.mark.parametrize(
    ("names", "parts"),
    [
        ("Hips LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase", "pelvis left_pelvis left_thigh left_shin left_foot left_toe"),
        ("LowerBack Neck1 LeftShoulder LeftArm LeftForeArm LThumb", "abdomen neck left_collar left_upper_arm left_forearm left_finger"),
        ("mixamorig:RightUpLeg mixamorig:RightLeg mixamorig:Spine2", "right_thigh right_shin torso"),
        ("hip chest lCollar lShldr lForeArm lHand rThigh rShin lButtock", "pelvis torso left_collar left_upper_arm left_forearm left_hand right_thigh right_shin left_pelvis"),
        ("thigh.L shin.R upper_arm.L f_index.01.L shoulder.R upper_arm.R", "left_thigh right_shin left_upper_arm left_finger right_collar right_upper_arm"),
        ("Bip01_L_Calf Bip01_R_Thigh Bip01_R_UpperArm Bip01_L_Clavicle", "left_shin right_thigh right_upper_arm left_collar"),
        ("LeftHip LeftKnee LeftAnkle LeftCollar LeftShoulder LeftElbow LeftWrist", "left_thigh left_shin left_foot left_collar left_upper_arm left_forearm left_hand"),
        ("Tail Rope1", ""),
    ],
)  # fmt: skip
def test_parts(names, parts):
    found = roles(names.split())
    assert " ".join(str(found[name]) for name in names.split() if name in found) == parts
