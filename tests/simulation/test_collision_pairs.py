"""Which pairs of shapes are looked at, and what is said of those that are not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh
from conftest import example_robots
from pair_rigs import boxes, loose, put, ragdoll

import articulated as art


def reason(rig, a, b, collisions=True):
    left_out = art.collision_pairs(rig, collisions).left_out
    return left_out.get((a, b), left_out.get((b, a)))


def names(pairs):
    return {frozenset(pair) for pair in pairs}


class TestChoice:
    def test_a_ragdoll(self):
        rig = ragdoll()
        choice = art.collision_pairs(rig)
        pairs = names(choice.pairs)
        for a, b in (
            ("left_forearm", "torso"),
            ("left_forearm", "head"),
            ("left_thigh", "right_thigh"),
            ("left_shin", "right_shin"),
        ):
            assert {a, b} in pairs
        for a, b in (("left_forearm", "left_upper_arm"), ("pelvis", "torso"), ("left_thigh", "pelvis")):
            assert reason(rig, a, b) == "joined"
        assert not pairs & names(choice.left_out)

    def test_what_touches_in_no_pose_is_left_out(self):
        """Against many more poses than the choice looked at."""
        rig = ragdoll()
        choice = art.collision_pairs(rig)
        never = [pair for pair, why in choice.left_out.items() if why == "never touch"]
        assert never
        simulation = art.Simulation(rig, collisions=art.Collisions(pairs=never))
        gaps = simulation.contacts(simulation.reset(rig.random(7, 20_000))).gaps
        assert gaps.min() > 0.0

    def test_limits_count(self):
        """Two fingers on a palm, that could touch were it not for their stops."""

        def hand(most):
            builder = art.RigBuilder("hand")
            builder.link("palm", 1.0, (0, 0, 0), (0.01, 0.01, 0.01))
            for k, y in enumerate((-0.05, 0.05)):
                builder.link(f"finger{k}", 0.1, (0, 0, 0.0), (1e-4, 1e-4, 1e-4), [art.Capsule(0.01, 0.1)])
                limits = art.Limits(-most, most)
                builder.joint(f"joint{k}", "revolute", "palm", f"finger{k}", xyz=(0, y, 0), axis=(1, 0, 0), limits=limits)
            return builder.build("free")

        assert reason(hand(0.2), "finger0", "finger1") == "never touch"
        assert art.collision_pairs(hand(1.5)).pairs == (("finger0", "finger1"),)

    def test_what_overlaps_when_neutral_is_left_out(self):
        builder = art.RigBuilder("stack")
        builder.link("base", 1.0, (0, 0, 0), (0.1, 0.1, 0.1), [art.Sphere(0.2)])
        builder.link("middle", 1.0, (0, 0, 0), (0.1, 0.1, 0.1))
        builder.link("top", 1.0, (0, 0, 0), (0.1, 0.1, 0.1), [art.Sphere(0.2)])
        builder.joint("a", "ball", "base", "middle")
        builder.joint("b", "ball", "middle", "top", xyz=(0.3, 0, 0))
        rig = builder.build("free")
        assert reason(rig, "base", "top") == "overlap when neutral"
        included = art.collision_pairs(rig, art.Collisions(include=[("base", "top")]))
        assert included.pairs == (("base", "top"),)

    def test_several_rigs(self):
        """All of one with all of the other; a robot's own pairs as before, but for some that hardly ever touch."""
        rig = art.compose(left=ragdoll(), right=ragdoll(), ball=loose(art.Sphere(0.1), 1.0))
        pairs = names(art.collision_pairs(rig).pairs)
        own = {frozenset((f"left/{a}", f"left/{b}")) for a, b in art.collision_pairs(ragdoll()).pairs}
        assert len(own ^ {pair for pair in pairs if all(name.startswith("left/") for name in pair)}) < 6
        links = [name for name, link in ragdoll().links.items() if link.collisions]
        assert {frozenset((f"left/{a}", f"right/{b}")) for a in links for b in links} <= pairs
        assert {frozenset(("ball/body", f"right/{a}")) for a in links} <= pairs

    def test_groups_and_patterns(self):
        rig = art.compose(boxes(3), **{f"ball{k}": loose(art.Sphere(0.1), 1.0) for k in range(3)})
        groups = {"balls": ["ball*"], "low": ["*box0/body", "*box1/body"]}
        collisions = art.Collisions(groups=groups, exclude=[("balls", "balls"), ("low", "balls")])
        pairs = names(art.collision_pairs(rig, collisions).pairs)
        assert len(pairs) == 15 - 3 - 6
        assert reason(rig, "ball0/body", "ball1/body", collisions) == "excluded"
        again = art.collision_pairs(rig, art.Collisions(groups=groups, exclude=[("*", "*")], include=[("low", "balls")]))
        assert len(again.pairs) == 6

    def test_a_source_disables_pairs(self):
        robots = example_robots()
        folder = robots / "panda_description"
        rig = art.load(folder / "urdf" / "panda.urdf", srdf=folder / "srdf" / "panda.srdf", mesh_dirs=[robots.parent])
        assert reason(rig, "panda_link1", "panda_link3") == "disabled in the rig's source"

    def test_joined_by_a_loop(self):
        builder = art.RigBuilder("joined")
        for name in "abc":
            builder.link(name, 1.0, (0, 0, 0), (0.01, 0.01, 0.01), [art.Sphere(0.1)])
        builder.joint("one", "revolute", "a", "b", xyz=(0.25, 0, 0), axis=(0, 0, 1))
        builder.joint("two", "revolute", "b", "c", xyz=(0.25, 0, 0), axis=(0, 0, 1))
        assert art.collision_pairs(builder.build("free")).pairs == (("a", "c"),)
        builder.loop(art.Loop("point", "a", None, "c", None))
        assert reason(builder.build("free"), "a", "c") == "joined"


class TestMaterials:
    def test_the_last_that_matches_counts(self):
        """Of three balls on slopes of their own, the slippery one slides."""
        parts = {f"crate{k}": loose(art.Box((0.2, 0.2, 0.2)), 1.0) for k in range(3)}
        rig = art.compose(**parts)
        q = rig.neutral()
        for k in range(3):
            put(rig, q, k, (0.0, 0.5 * k, 0.1))
        floor = art.Shape(art.Box((10.0, 10.0, 0.2)), np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.1], [0, 0, 0, 1.0]]))
        smooth, rough = art.Material(friction=0.1), art.Material(friction=2.0)
        materials = {("crate*", "scenery"): smooth, ("scenery", "crate2/body"): rough}
        gravity = 9.81 * np.array([np.sin(0.4), 0.0, -np.cos(0.4)])
        run = art.Simulation(rig, gravity=gravity, collisions=art.Collisions(scenery=floor, materials=materials)).run(
            q, duration=0.5
        )
        assert run.q[-1, [0, 7]] == pytest.approx(0.5 * 9.81 * (np.sin(0.4) - 0.1 * np.cos(0.4)) * 0.25, rel=0.05)
        assert abs(run.q[-1, 14]) < 1e-3


class TestMeshes:
    def test_a_mesh_of_many_vertices_is_told(self, tmp_path):
        """It touches as a simpler hull; that it is not closed does not matter."""
        sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
        sphere.update_faces(np.arange(len(sphere.faces)) > 10)
        sphere.export(tmp_path / "sphere.stl")
        builder = art.RigBuilder("ball")
        mesh = art.Mesh("sphere.stl", path=tmp_path / "sphere.stl")
        builder.link("body", 1.0, (0, 0, 0), 0.004 * np.eye(3), collisions=[mesh])
        floor = art.Shape(art.Box((2.0, 2.0, 0.2)))
        with pytest.warns(
            art.RigWarning, match=r"mesh 'sphere\.stl' of link 'body' touches as a hull of 12 vertices, up to .* mm"
        ):
            simulation = art.Simulation(builder.build("free"), collisions=art.Collisions(scenery=floor))
        end = simulation.run([0, 0, 0.25, 0, 0, 0, 1], duration=2.0).q[-1]
        assert 0.17 < end[2] < 0.2


class TestTrouble:
    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            (
                {"include": [("torso", "hed")]},
                r"include: 'hed' is no link, no group, and no pattern that matches any; did you mean 'head'\?",
            ),
            ({"exclude": [("arms*", "torso")]}, r"exclude: 'arms\*' is no link"),
            ({"groups": {"arms": ["left_arm"]}}, r"group 'arms': 'left_arm' is no link"),
            ({"materials": {("a", "torso"): art.Material()}}, r"materials: 'a' is no link"),
            ({"pairs": [("torso", "torso")]}, r"pairs: \('torso', 'torso'\) has no two shapes"),
            ({"pairs": [("torso",)]}, r"pairs holds \('torso',\); expected pairs of names"),
            ({"pairs": ["torso"]}, r"pairs holds 'torso'; expected pairs"),
            ({"scenery": ["box"]}, r"scenery holds 'box'; expected shapes"),
            ({"friction": -1.0}, r"friction is -1.0; expected a number, zero or more"),
            ({"restitution": 1.5}, r"restitution is 1.5"),
            ({"materials": {("head", "torso"): 0.3}}, r"the material of \('head', 'torso'\) is 0.3; expected a Material"),
        ],
    )
    def test_bad_descriptions(self, settings, message):
        with pytest.raises(ValueError, match=message):
            art.Simulation(ragdoll(), collisions=art.Collisions(**settings))

    def test_pairs_on_one_body(self):
        builder = art.RigBuilder("hand")
        builder.link("palm", 1.0, (0, 0, 0), (0.1, 0.1, 0.1), [art.Sphere(0.1)])
        builder.link("thumb", 0.0, collisions=[art.Sphere(0.1)])
        builder.joint("fixed", "fixed", "palm", "thumb", xyz=(0.3, 0, 0))
        with pytest.raises(ValueError, match=r"pairs: \('palm', 'thumb'\) is on one body"):
            art.Simulation(builder.build("free"), collisions=art.Collisions(pairs=[("palm", "thumb")]))

    def test_not_a_collisions(self):
        with pytest.raises(ValueError, match=r"collisions is 'all'; expected a Collisions, True or None"):
            art.Simulation(ragdoll(), collisions="all")

    def test_bodies_that_start_in_each_other(self):
        """Are pushed apart, and not fast; and it is told which."""
        rig = art.compose(a=loose(art.Sphere(0.1), 1.0), b=loose(art.Sphere(0.1), 1.0))
        q = np.tile(rig.neutral(), (3, 1))
        q[:, 7] = (0.15, 0.5, 0.12)
        simulation = art.Simulation(rig, gravity=(0, 0, 0), collisions=True)
        message = r"2 of 3 states of rig 'a \+ b' start with bodies in each other, 'a/body' and 'b/body' by 80 mm"
        with pytest.warns(art.RigWarning, match=message):
            run = simulation.run(q, duration=1.5, fps=20)
        speed = run.v[..., 6] - run.v[..., 0]
        assert 0.05 < speed.max() < 0.11
        assert run.contact_gaps[:, -1].min() > 0.0
        assert not run.report["penetration"].passed
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            simulation.run(q[1], duration=0.1)
