"""Loops as they are described: in Python, in URDF, and in rigs composed of others; and assembly."""

from __future__ import annotations

import numpy as np
import pytest

import articulated as art

URDF = """<robot name="bars" xmlns:drake="http://drake.mit.edu">
  <link name="base"/>
  <link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="ja" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
  <joint name="jb" type="spherical"><parent link="base"/><child link="b"/><origin xyz="1 0 0"/></joint>
  {}
</robot>"""


def bars(text):
    return art.load(URDF.format(text))


class TestUrdf:
    @pytest.mark.parametrize(
        ("type_", "kind"),
        [
            ("spherical", "point"),
            ("revolute", "hinge"),
            ("prismatic_joint", "slider"),
            ("universal", "universal"),
            ("link", "weld"),
        ],
    )
    def test_constraint(self, type_, kind):
        rig = bars(
            f"""<constraint name="c" type="{type_}"><parent link="a"/><parent_origin xyz="0 0 1" rpy="0 0 0.5"/><parent_axis xyz="0 2 0"/>
            <child link="b"/><child_origin xyz="1 0 0"/><child_axis xyz="0 0 1"/></constraint>"""
        )
        (loop,) = rig.loops
        assert (loop.kind, loop.name, loop.link_a, loop.link_b) == (kind, "c", "a", "b")
        expected = np.array([[np.cos(0.5), -np.sin(0.5), 0, 0], [np.sin(0.5), np.cos(0.5), 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
        np.testing.assert_allclose(loop.pose_a, expected, atol=1e-15)
        if kind in ("hinge", "slider", "universal"):
            np.testing.assert_allclose(loop.frames[0][:3, 2], expected[:3, :3] @ [0, 1, 0], atol=1e-15)  # the axis is in A
        if kind == "universal":
            np.testing.assert_allclose(loop.frames[1][:3, 2], [0, 0, 1], atol=1e-15)

    def test_drake_ball(self):
        rig = bars(
            """<drake:ball_constraint><drake:ball_constraint_body_A name="a"/><drake:ball_constraint_body_B name="b"/>
            <drake:ball_constraint_p_AP value="0 0 1"/><drake:ball_constraint_p_BQ value="1 2 3"/></drake:ball_constraint>"""
        )
        (loop,) = rig.loops
        assert loop.kind == "point"
        np.testing.assert_array_equal(loop.frames[0][:3, 3], [0, 0, 1])
        np.testing.assert_array_equal(loop.frames[1][:3, 3], [1, 2, 3])

    @pytest.mark.parametrize("type_", ["spherical", "revolute", "prismatic", "universal", "link"])
    def test_written_and_read_again(self, type_):
        rig = bars(
            f"""<constraint name="c" type="{type_}"><parent link="a"/><parent_origin xyz="0 0 1" rpy="0.1 0.2 0.5"/>
            <parent_axis xyz="0 2 1"/><child link="b"/><child_origin xyz="1 0 0"/><child_axis xyz="1 0 1"/></constraint>"""
        )
        again = art.load(rig.to_urdf())
        q = rig.random(0, 5)
        J, K = art.loop_jacobian(rig, None, q), art.loop_jacobian(again, None, q)
        for one, other in zip(J, K, strict=True):  # rows may be turned about the axis
            np.testing.assert_allclose(one.T @ one, other.T @ other, atol=1e-12)

    def test_what_urdf_cannot_say_is_told(self):
        builder = art.RigBuilder("one")
        builder.link("base")
        builder.link("a", 1.0, inertia=(1, 1, 1))
        builder.joint("ja", "ball", "base", "a")
        builder.loop(art.Loop("distance", "base", (0, 0, 2), "a", None, length=2.0, name="rod"))
        rig = builder.build()
        with pytest.warns(art.RigWarning, match="URDF has no constraint for loops 'rod'"):
            text = rig.to_urdf()
        assert not art.load(text).loops

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ('<constraint type="link"/>', "<constraint>: has no name"),
            ('<constraint name="c"/>', "constraint 'c': has no type"),
            ('<constraint name="c" type="screw"/>', "unknown type 'screw'; use one of spherical, revolute"),
            ('<constraint name="c" type="link"><parent link="a"/></constraint>', "constraint 'c': has no <child>"),
            (
                '<constraint name="c" type="link"><parent link="a"/><child link="bb"/></constraint>',
                "no link 'bb'; did you mean 'b'",
            ),
            ('<constraint name="c" type="link"><parent link="a"/><child link="a"/></constraint>', "parts of one rigid body"),
            (
                '<constraint name="c" type="revolute"><parent link="a"/><child link="b"/><parent_axis xyz="0 0 0"/></constraint>',
                "not all zero",
            ),
            (
                '<constraint name="c" type="link"><parent link="a"/><child link="b"/></constraint>' * 2,
                "another loop has this name; rename it",
            ),
            ("<drake:ball_constraint/>", "<drake:ball_constraint>: has no <{http://drake.mit.edu}ball_constraint_body_A>"),
        ],
    )
    def test_errors(self, text, message):
        with pytest.raises(art.RigError) as error:
            bars(text)
        assert message in str(error.value)
        assert error.value.line is not None


class TestLoop:
    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: art.Loop("wled", "a", None, "b", None), "kind of loop is 'wled'; expected one of .*; did you mean 'weld'"),
            (lambda: art.Loop("hinge", "a", None, "b", None), "loop 'hinge a-b' needs axis=, a direction"),
            (lambda: art.Loop("weld", "a", None, "b", None, axis=(0, 0, 1)), "has no use for axis"),
            (lambda: art.Loop("universal", "a", None, "b", None, axis=(0, 0, 1)), "needs axis2="),
            (lambda: art.Loop("hinge", "a", None, "b", None, axis=(0, 0, 0)), "axis of .* not all zero"),
            (lambda: art.Loop("hinge", "a", None, "b", None, axis=(0, np.nan, 0)), "axis of .* not all zero"),
            (lambda: art.Loop("distance", "a", None, "b", None), "needs length="),
            (lambda: art.Loop("distance", "a", None, "b", None, length=0.0), "expected more than 0; a point loop"),
            (lambda: art.Loop("distance", "a", None, "b", None, length=np.inf), "expected a finite number"),
            (lambda: art.Loop("weld", "a", None, "b", None, length=1.0), "has no use for length"),
            (lambda: art.Loop("weld", "a", None, "b", None, rope=True), "cannot be a rope; only a distance can"),
            (lambda: art.Loop("gear", "a", None, "b", None), "needs ratio="),
            (lambda: art.Loop("gear", "a", (0, 0, 1), "b", None, ratio=1.0), "joins joints and has no use for pose_a"),
            (
                lambda: art.Loop("weld", "a", np.eye(3), "b", None),
                r"pose_a of .* has shape \(3, 3\); expected \(4, 4\) or \(3,\)",
            ),
            (lambda: art.Loop("weld", "a", 2.0 * np.eye(4), "b", None), "is not a rotation and a translation"),
            (lambda: art.Loop("weld", "a", (0, np.nan, 0), "b", None), "pose_a of .* holds nan"),
            (lambda: art.Loop("weld", "a", "x", "b", None), "expected numbers"),
        ],
    )
    def test_what_no_loop_can_be(self, make, message):
        with pytest.raises(ValueError, match=message):
            make()

    def test_world_is_a_link_if_there_is_one(self):
        assert art.loop_gaps(bars(""), [art.Loop("point", "world", None, "a", None)], [0, 0, 0, 0, 1]).tolist() == [0, 0, 0]

    def test_rows_have_names(self):
        assert art.Loop("weld", "a", None, "b", None).rows == ("x", "y", "z", "about x", "about y", "about z")
        assert len(art.Loop("planar", "a", None, "b", None, axis=(1, 0, 0)).rows) == 3


class TestCompose:
    def test_is_its_parts(self):
        one, two = art.load("ragdoll", root="free"), art.load("cartpole")
        rig = art.compose(left=one, cart=two)
        assert (rig.nq, rig.nv) == (one.nq + two.nq, one.nv + two.nv)
        assert "left/left_hand" in rig.links
        assert "cart/cart" in rig.links
        rng = np.random.default_rng(0)
        parts = [(r.random(rng), rng.normal(size=r.nv), rng.normal(size=r.nv)) for r in (one, two)]
        q, v, tau = (np.concatenate(x) for x in zip(*parts, strict=True))
        expected = np.concatenate([art.forward_dynamics(r, *x) for r, x in zip((one, two), parts, strict=True)])
        np.testing.assert_allclose(art.forward_dynamics(rig, q, v, tau), expected, rtol=1e-9, atol=1e-9)
        assert rig.mass == pytest.approx(one.mass + two.mass)
        again = art.load(rig.to_urdf())
        assert list(again.joints) == list(rig.joints)

    def test_in_motion(self):
        """Each of several free rigs moves as it does alone: with contact, and in flight, in any place."""
        builder = art.RigBuilder("walker")
        builder.link("trunk", 4.0, inertia=np.eye(3) * 0.05, collisions=[art.Box((0.3, 0.2, 0.2))])
        for name, y, kind in (("left", 0.12, "ball"), ("right", -0.12, "revolute")):
            shape = art.Shape(art.Capsule(0.04, 0.2), np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.15], [0, 0, 0, 1.0]]))
            builder.link(name, 1.0, (0, 0, -0.15), np.eye(3) * 0.01, [shape])
            builder.joint(f"{name}_hip", kind, "trunk", name, xyz=(0, y, -0.1))
        one = builder.build("free")
        rig = art.compose(a=one, b=one)
        q1, q2 = one.neutral(), one.neutral()
        q1[:3], q2[:3] = (0, 0, 0.42), (5.0, -3.0, 0.4)
        v = np.random.default_rng(0).normal(size=(2, one.nv)) * 0.3
        for settings in ({"ground": True}, {"limits": False, "integrator": "semi_implicit"}):
            both = art.Simulation(rig, dt=1e-3, **settings).run(np.r_[q1, q2], v.ravel(), duration=0.15, fps=20).q[-1]
            apart = [
                art.Simulation(one, dt=1e-3, **settings).run(q, w, duration=0.15, fps=20).q[-1]
                for q, w in zip((q1, q2), v, strict=True)
            ]
            np.testing.assert_allclose(both, np.concatenate(apart), atol=2e-4)

    def test_keeps_loops_and_joint_properties(self):
        rig = bars('<constraint name="c" type="link"><parent link="a"/><child link="b"/></constraint>')
        both = art.compose(x=rig.with_joints(damping=0.5), y=rig)
        assert [loop.name for loop in both.loops] == ["x/c", "y/c"]
        assert both.loops[1].link_a == "y/a"
        np.testing.assert_array_equal(both.damping, [0.5] * 4 + [0.0] * 4)

    def test_followers_and_roots(self):
        builder = art.RigBuilder("follow")
        builder.link("base")
        for name in "ab":
            builder.link(name, 1.0, inertia=(1, 1, 1))
        builder.joint("ja", "revolute", "base", "a", limits=art.Limits(-1, 1))
        builder.joint("jb", "revolute", "base", "b", mimic=art.Mimic("ja", 2.0, 0.5), limits=art.Limits(-1, 1))
        for root in ("fixed", "free", "planar"):
            rig = builder.build(root)
            both = art.compose(x=rig, y=rig)
            assert both.nv == 2 * rig.nv
            q = np.concatenate([rig.random(1), rig.random(2)])
            ends = art.link_poses(both, q)[both.links["y/b"].index], art.link_poses(rig, q[rig.nq :])[rig.links["b"].index]
            np.testing.assert_allclose(*ends, atol=1e-14)

    def test_errors(self):
        rig = bars("")
        with pytest.raises(ValueError, match="no rig"):
            art.compose()
        with pytest.raises(ValueError, match="give each its own: compose"):
            art.compose(rig, rig)


class TestAssembly:
    def two_rods(self, length=0.6, limits=None):
        builder = art.RigBuilder("rods")
        builder.link("base")
        for k, above in enumerate(("base", "rod0")):
            builder.link(f"rod{k}", 1.0, (0.25, 0, 0), (0.01, 0.1, 0.1))
            at = (0.5, 0, 0) if k else (0, 0, 0)
            builder.joint(f"j{k}", "revolute", above, f"rod{k}", xyz=at, axis=(0, -1, 0), limits=limits or art.Limits(-3, 3))
        builder.loop(art.Loop("distance", None, None, "rod1", (0.5, 0, 0), length=length, name="span"))
        return builder.build()

    def test_keeps_the_branch(self):
        rig = self.two_rods()
        for sign in (1.0, -1.0):
            q = art.assemble(rig, None, [0.3, 0.4 * sign])
            assert np.abs(art.loop_gaps(rig, None, q)).max() < 1e-12
            assert q[1] * sign > 0.0

    def test_batch_and_held_joints(self):
        rig = self.two_rods()
        guesses = np.stack([np.linspace(-1, 1, 7), np.full(7, 1.5)], axis=-1)
        q = art.assemble(rig, None, guesses, hold="j0")
        np.testing.assert_array_equal(q[:, 0], guesses[:, 0])
        assert np.abs(art.loop_gaps(rig, None, q)).max() < 1e-12

    def test_limits_hold(self):
        rig = self.two_rods(0.9, art.Limits(-0.95, 0.95))
        q = art.assemble(rig, None, [0.5, 0.2])
        assert np.abs(q).max() <= 0.95
        assert np.abs(art.loop_gaps(rig, None, q)).max() < 1e-12

    def test_what_cannot_close_says_why(self):
        with pytest.raises(
            art.AssemblyError, match=r"open are span: along by 0\.2 \(m or rad\); no joint is at a limit"
        ) as error:
            art.assemble(self.two_rods(1.2), None, [0.1, 0.1])
        assert error.value.gaps[0] == pytest.approx(-0.2, abs=1e-6)
        with pytest.raises(art.AssemblyError, match=r"span: along by .* at their limits: j1"):
            art.assemble(self.two_rods(0.3, art.Limits(-1.0, 1.0)), None, [0.1, 0.1])

    def test_ropes_may_be_slack(self):
        rig = self.two_rods()
        rope = art.Loop("distance", None, None, "rod1", (0.5, 0, 0), length=0.9, rope=True)
        np.testing.assert_array_equal(art.assemble(rig, [rope], [0.3, 2.5]), [0.3, 2.5])
        q = art.assemble(rig, [rope], [0.3, 0.2])
        assert -0.1 < art.loop_gaps(rig, [rope], q)[0] < 1e-11

    def test_bad_guesses(self):
        rig = self.two_rods()
        with pytest.raises(ValueError, match="q_guess has shape"):
            art.assemble(rig, None, [1.0])
        with pytest.raises(ValueError, match="hold: rig 'rods' has no moving joint 'j7'"):
            art.assemble(rig, hold=["j7"])
