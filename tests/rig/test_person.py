"""A person: the mass and height asked for, mirror images left and right, the table's numbers, and a second on the ground."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import articulated as art
from articulated.dynamics.swing_twist import tilt_and_twist
from articulated.rig.anthropometry import MEAN_HEIGHT, MEAN_MASS, other_ends, segments

PEOPLE = [(1.75, 70.0, "male"), (1.62, 58.0, "female"), (1.1, 18.0, "female"), (2.1, 140.0, "male"), (1.6, 150.0, "female")]

SEGMENTS = {
    "pelvis": "lower_trunk",
    "abdomen": "middle_trunk",
    "torso": "upper_trunk",
    "head": "head",
    "upper_arm": "upper_arm",
    "forearm": "forearm",
    "hand": "hand",
    "thigh": "thigh",
    "shin": "shank",
    "foot": "foot",
}


def part_of(name: str) -> str:
    return SEGMENTS[name.removeprefix("left_").removeprefix("right_")]


def corners(rig: art.Rig, name: str) -> np.ndarray:
    """Points that span the shape of a link in the world, standing at neutral, soles at zero: corners, or ends of a capsule."""
    q = rig.neutral()
    q[2] = art.standing_height(rig)
    (shape,) = rig.links[name].collisions
    X = art.link_poses(rig, q)[rig.links[name].index] @ shape.pose
    if isinstance(shape.geometry, art.Box):
        ends = 0.5 * np.array(shape.geometry.size) * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    else:
        ends = np.array([[0.0, 0.0, sign * (0.5 * shape.geometry.length + shape.geometry.radius)] for sign in (-1.0, 1.0)])
    return ends @ X[:3, :3].T + X[:3, 3]


def allowed(joint: art.Joint, axis, degrees: float) -> bool:
    """Whether a ball joint may turn so, from neutral."""
    limits = joint.limits.ball
    quat_xyzw = Rotation.from_rotvec(np.radians(degrees) * np.array(axis, dtype=float)).as_quat()
    one, other, twist = (float(x) for x in tilt_and_twist(limits, quat_xyzw))
    swing = np.hypot(one / limits.swing[0 if one > 0 else 1], other / limits.swing[2 if other > 0 else 3])
    return bool(swing <= 1.0 and limits.twist[0] <= twist <= limits.twist[1])


@pytest.mark.parametrize(("height", "mass", "sex"), PEOPLE)
class TestAnyone:
    def test_mass_and_height(self, height, mass, sex):
        rig = art.person(height, mass, sex)
        assert rig.mass == pytest.approx(mass, rel=1e-14)
        assert sum(link.mass for link in rig.links.values()) == pytest.approx(mass, rel=1e-14)
        assert corners(rig, "head")[:, 2].max() == pytest.approx(height, abs=1e-12)
        for side in ("left", "right"):
            assert corners(rig, f"{side}_foot")[:, 2].min() == pytest.approx(0.0, abs=1e-12)

    def test_masses_are_the_tables(self, height, mass, sex):
        rig = art.person(height, mass, sex)
        for link in rig.links.values():
            assert link.mass / mass == pytest.approx(segments(sex)[part_of(link.name)].mass, rel=2e-4)  # of 99.99 %

    def test_right_mirrors_left(self, height, mass, sex):
        rig = art.person(height, mass, sex)
        mirror = np.diag([1.0, -1.0, 1.0])
        X = art.link_poses(rig, rig.neutral())
        for name, left in rig.links.items():
            if not name.startswith("left_"):
                if not name.startswith("right_"):
                    np.testing.assert_allclose(mirror @ left.center, left.center)
                continue
            right = rig.links[name.replace("left_", "right_")]
            assert left.mass == right.mass
            np.testing.assert_allclose(mirror @ left.center, right.center)
            np.testing.assert_allclose(mirror @ left.inertia @ mirror, right.inertia)
            np.testing.assert_allclose(mirror @ X[left.index, :3, 3], X[right.index, :3, 3], atol=1e-15)
            a, b = corners(rig, left.name) @ mirror, corners(rig, right.name)
            np.testing.assert_allclose(a[np.lexsort(a.round(9).T)], b[np.lexsort(b.round(9).T)], atol=1e-12)

    def test_moves_as_a_mirror_image(self, height, mass, sex):
        """The same angle at the left and at the right hinge mirrors the pose: axes and signs agree."""
        rig = art.person(height, mass, sex)
        q = rig.neutral()
        for joint, value in (("elbow", 1.0), ("knee", 0.7)):
            for side in ("left", "right"):
                q[rig.joints[f"{side}_{joint}"].q_slice] = value
        X = art.link_poses(rig, q)
        for part in ("hand", "foot"):
            left, right = (X[rig.links[f"{side}_{part}"].index, :3, 3] for side in ("left", "right"))
            np.testing.assert_allclose(left * (1, -1, 1), right, atol=1e-12)
        assert X[rig.links["left_hand"].index, 0, 3] > 0.1  # an elbow bends forwards
        assert X[rig.links["left_foot"].index, 0, 3] < -0.1  # and a knee backwards

    def test_its_shapes_weigh_what_it_does(self, height, mass, sex):
        rig = art.person(height, mass, sex)
        for link in rig.links.values():
            solid = art.mass_properties(link.collisions, 1000.0)
            fat = isinstance(link.collisions[0].geometry, art.Capsule) and link.collisions[0].geometry.length < 0.03 * height
            assert solid.mass == pytest.approx(link.mass, rel=1e-9) or (fat and solid.mass < link.mass), link.name

    def test_thighs_do_not_touch(self, height, mass, sex):
        rig = art.person(height, mass, sex)
        (shape,) = rig.links["left_thigh"].collisions
        at = art.link_poses(rig, rig.neutral())[rig.links["left_thigh"].index] @ shape.pose
        assert at[1, 3] > shape.geometry.radius


@pytest.mark.parametrize("sex", ["female", "male"])
class TestAgainstTheTable:
    """The mean woman and the mean man."""

    def test_lengths(self, sex):
        rig = art.person(MEAN_HEIGHT[sex], MEAN_MASS[sex], sex)
        X = {name: pose[:3, 3] for name, pose in zip(rig.links, art.link_poses(rig, rig.neutral()), strict=True)}
        rows = {**segments(sex), **other_ends(sex)}
        for a, b, row in (("left_upper_arm", "left_forearm", "upper_arm"), ("left_forearm", "left_hand", "forearm")):
            assert np.linalg.norm(X[a] - X[b]) == pytest.approx(rows[row].length, rel=1e-12)
        shrunk = [
            (np.linalg.norm(X[a] - X[b]) / rows[row].length)
            for a, b, row in (
                ("left_thigh", "left_shin", "thigh"),
                ("left_shin", "left_foot", "shank to ankle"),
                ("pelvis", "abdomen", "lower_trunk"),
                ("abdomen", "torso", "middle_trunk"),
                ("torso", "head", "upper_trunk from cervicale"),
            )
        ]
        np.testing.assert_allclose(shrunk, shrunk[0], rtol=1e-12)
        assert shrunk[0] == pytest.approx(1.0, abs=0.025)

    def test_centres_and_radii(self, sex):
        rig = art.person(MEAN_HEIGHT[sex], MEAN_MASS[sex], sex)
        rows = segments(sex)
        for name, axes in (
            ("abdomen", ("sagittal", "transverse", "longitudinal")),
            ("left_thigh", ("sagittal", "transverse", "longitudinal")),
            ("left_upper_arm", ("sagittal", "longitudinal", "transverse")),
            ("right_forearm", ("sagittal", "longitudinal", "transverse")),
            ("left_hand", ("transverse", "longitudinal", "sagittal")),
            ("right_foot", ("longitudinal", "transverse", "sagittal")),
            ("left_shin", ("sagittal", "transverse", "longitudinal")),
            ("torso", ("sagittal", "transverse", "longitudinal")),
            ("head", ("sagittal", "transverse", "longitudinal")),
            ("pelvis", ("sagittal", "transverse", "longitudinal")),
        ):
            link, row = rig.links[name], rows[part_of(name)]
            radii = np.sqrt(np.diag(link.inertia) / link.mass)
            # rows of one part agree to the digits printed, not better
            np.testing.assert_allclose(radii, [getattr(row, axis) * row.length for axis in axes], atol=4e-4, err_msg=name)
            np.testing.assert_array_equal(link.inertia, np.diag(np.diag(link.inertia)))
        assert rig.links["left_upper_arm"].center[1] == pytest.approx(rows["upper_arm"].center * rows["upper_arm"].length)
        knee = -rig.joints["left_knee"].pose[2, 3]
        assert -rig.links["left_thigh"].center[2] / knee == pytest.approx(rows["thigh"].center)
        waist = rig.joints["waist"].pose[2, 3]
        assert rig.links["pelvis"].center[2] / waist == pytest.approx(1.0 - rows["lower_trunk"].center)

    def test_feet(self, sex):
        """The ankle stands over the first quarter of the foot, 0.039 of the height above the sole."""
        rig = art.person(MEAN_HEIGHT[sex], MEAN_MASS[sex], sex)
        row, foot, box = segments(sex)["foot"], rig.links["left_foot"], corners(rig, "left_foot")
        ankle = rig.neutral()[0]
        assert (box[:, 0].min(), box[:, 0].max()) == pytest.approx((ankle - 0.25 * row.length, ankle + 0.75 * row.length))
        assert foot.center[0] == pytest.approx((row.center - 0.25) * row.length)
        legs = -rig.joints["left_knee"].pose[2, 3] - rig.joints["left_ankle"].pose[2, 3]
        assert art.standing_height(rig) - legs == pytest.approx(0.039 * MEAN_HEIGHT[sex])

    def test_centre_of_mass(self, sex):
        """Arms out it is a little above the usual 55 to 57 % of the height: of arms that hang."""
        rig = art.person(MEAN_HEIGHT[sex], MEAN_MASS[sex], sex)
        q = rig.neutral()
        q[2] = art.standing_height(rig)
        assert 0.54 < art.center_of_mass(rig, q)[2] / MEAN_HEIGHT[sex] < 0.62


class TestRig:
    def test_reads_like_the_ragdoll(self):
        person, ragdoll = art.person(), art.load("ragdoll", "free")
        assert set(ragdoll.links) - set(person.links) == set()
        for name in ("left_elbow", "right_elbow", "left_knee", "right_wrist", "left_ankle"):
            a, b = person.joints[name], ragdoll.joints[name]
            assert a.kind == b.kind
            np.testing.assert_array_equal(a.axis, b.axis)
            assert a.axis2 is None or (a.axis2 == b.axis2).all()
        kinds = {joint.name: joint.kind for joint in person.joints.values()}
        assert [kinds[name] for name in ("waist", "spine", "neck", "left_shoulder", "right_hip")] == ["ball"] * 5
        assert len(person.bodies) == 16

    def test_limits_hold_the_neutral_pose(self):
        rig = art.person()
        for joint in rig.joints.values():
            if joint.kind == "ball":
                assert allowed(joint, (1.0, 0.0, 0.0), 0.0)
            elif joint.kind != "floating":
                assert joint.limits.lower <= 0.0 <= joint.limits.upper

    @pytest.mark.parametrize(
        ("joint", "axis", "most"),
        [
            ("hip", (0, -1, 0), 120),  # flexion
            ("hip", (0, 1, 0), 30),  # extension
            ("hip", (1, 0, 0), 45),  # abduction
            ("hip", (-1, 0, 0), 30),  # adduction
            ("hip", (0, 0, 1), 45),  # outwards
            ("hip", (0, 0, -1), 45),  # inwards
            ("shoulder", (0, 0, -1), 130),  # forwards
            ("shoulder", (0, 0, 1), 45),  # back
            ("shoulder", (1, 0, 0), 90),  # up: 180 from hanging
            ("shoulder", (-1, 0, 0), 100),  # down
            ("shoulder", (0, -1, 0), 90),  # forearm up: outwards
            ("shoulder", (0, 1, 0), 70),  # forearm down: inwards
            ("waist", (0, 1, 0), 40),  # forwards
            ("waist", (0, -1, 0), 12.5),
            ("waist", (1, 0, 0), 17.5),
            ("spine", (0, 0, 1), 22.5),
            ("neck", (0, 1, 0), 45),
            ("neck", (0, 0, -1), 60),
        ],
    )
    def test_ranges_of_motion(self, joint, axis, most):
        """By a turn about a world axis of the left side, whose mirror image the right side can do."""
        rig = art.person()
        names = [joint] if joint in rig.joints else [f"left_{joint}", f"right_{joint}"]
        for name, mirror in zip(names, ((1, 1, 1), (-1, 1, -1)), strict=False):
            turn = np.array(axis) * mirror  # axes of turns mirror the other way
            assert allowed(rig.joints[name], turn, most - 0.1)
            assert not allowed(rig.joints[name], turn, most + 0.1)

    def test_hinges(self):
        rig = art.person()
        for name, lower, upper in (("elbow", 0, 150), ("knee", 0, 135), ("wrist", -50, 50), ("ankle", -30, 30)):
            limits = rig.joints[f"left_{name}"].limits
            np.testing.assert_allclose((limits.lower, limits.upper), np.radians((lower, upper)))
            assert rig.joints[f"right_{name}"].limits == limits

    @pytest.mark.parametrize("root", ["fixed", "free", "planar"])
    def test_comes_back_from_urdf(self, root):
        rig = art.person(1.62, 58.0, "female", root=root)
        again = art.load(rig.to_urdf(), root)
        assert again.mass == pytest.approx(rig.mass, rel=1e-12)
        q = rig.random(0)
        np.testing.assert_allclose(art.link_poses(again, q), art.link_poses(rig, q), atol=1e-12)
        np.testing.assert_allclose(art.mass_matrix(again, q), art.mass_matrix(rig, q), atol=1e-10)
        for a, b in zip(rig.joints.values(), again.joints.values(), strict=True):
            assert (a.kind, a.limits, a.damping, a.armature) == (b.kind, b.limits, b.damping, b.armature)

    def test_a_second_on_the_ground(self):
        """From standing, and thrown at random: it falls, stays finite, does not sink in, and gains no energy."""
        rig = art.person()
        q = np.concatenate([rig.neutral()[None], rig.random(0, 3)])
        q[:, :3] = 0.0, 0.0, 1.5
        q[0, 2] = art.standing_height(rig)
        simulation = art.Simulation(rig, ground=True)
        run = simulation.run(q, np.zeros((4, rig.nv)), duration=1.0, fps=30)
        assert np.isfinite(run.q).all()
        energy = art.kinetic_energy(rig, run.q, run.v) + art.potential_energy(rig, run.q)
        assert np.abs(run.v).max() < 100.0
        assert (energy <= energy[:, :1] + 1.0).all()
        z = art.link_poses(rig, run.q)[..., 2, 3]
        assert z.min() > -0.05
        assert z[0, 5, 0] == pytest.approx(
            z[0, 0, 0], abs=0.03
        )  # not thrown up, nor fallen through, in the first sixth of a second

    @pytest.mark.parametrize("height", [175, 0.0, -1.75, np.nan, "tall", None, True])
    def test_height_refused(self, height):
        with pytest.raises(ValueError, match=r"height of a person is .*; expected 0\.5 to 2\.6 metres"):
            art.person(height)

    @pytest.mark.parametrize("mass", [0.0, -70.0, 70_000.0, np.nan, "heavy"])
    def test_mass_refused(self, mass):
        with pytest.raises(ValueError, match=r"mass of a person is .*; expected 3 to 500 kilograms"):
            art.person(1.75, mass)

    def test_others_refused(self):
        with pytest.raises(ValueError, match="sex is 'Male'; expected 'female' or 'male'"):
            art.person(sex="Male")
        with pytest.raises(ValueError, match="root is 'flying'; expected 'fixed', 'free' or 'planar'"):
            art.person(root="flying")


class TestStandingHeight:
    @pytest.mark.parametrize(
        ("geometry", "height"),
        [
            (art.Sphere(0.3), 0.3),
            (art.Box((0.2, 0.4, 0.6)), 0.3 * 0.8 + 0.2 * 0.6),
            (art.Cylinder(0.1, 0.6), 0.3 * 0.8 + 0.1 * 0.6),
            (art.Capsule(0.1, 0.6), 0.3 * 0.8 + 0.1),
        ],
    )
    def test_of_a_tilted_shape(self, geometry, height):
        X = np.eye(4)
        X[1:3, 1:3] = [[0.8, -0.6], [0.6, 0.8]]
        assert art.standing_height(art.loose_body(art.Shape(geometry, X))) == pytest.approx(height)

    def test_of_what_hangs(self):
        ragdoll = art.load("ragdoll", "free")
        assert art.standing_height(ragdoll) == pytest.approx(0.05 + 0.42 + 0.43 + 0.075)
        assert art.standing_height(art.load("ragdoll")) == art.standing_height(ragdoll)

    def test_refused(self):
        builder = art.RigBuilder("ghost")
        builder.link("ghost", 1.0, inertia=(1, 1, 1))
        with pytest.raises(ValueError, match="rig 'ghost' has no collision shape to stand on"):
            art.standing_height(builder.build("free"))
