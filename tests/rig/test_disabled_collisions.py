"""Pairs of links that may not collide: from URDF, SRDF and Python, and wherever a rig goes."""

from __future__ import annotations

import warnings
from itertools import pairwise

import pytest
from lxml import etree

import articulated as art

LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
)
JOINT = '<joint name="to_{1}" type="continuous"><parent link="{0}"/><child link="{1}"/></joint>'
CHAIN = "abcd"


def chain(*lines: str) -> str:
    """A URDF of four links in a row, then one line for each argument, from line 9 on."""
    links = [LINK.format(name) for name in CHAIN]
    joints = [JOINT.format(*pair) for pair in pairwise(CHAIN)]
    return "\n".join(['<robot name="chain">', *links, *joints, *lines, "</robot>"])


def srdf(*lines: str) -> str:
    return "\n".join(['<robot name="chain">', *lines, "</robot>"])


def disable(link1: str, link2: str) -> str:
    return f'<disable_collisions link1="{link1}" link2="{link2}" reason="Never"/>'


def enable(link1: str, link2: str) -> str:
    return f'<enable_collisions link1="{link1}" link2="{link2}"/>'


def default(link: str) -> str:
    return f'<disable_default_collisions link="{link}"/>'


def pairs(*names: str) -> tuple[tuple[str, str], ...]:
    return tuple((name[0], name[1]) for name in names)


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


class TestUrdf:
    def test_pairs_in_the_order_of_the_links_each_once(self):
        rig = art.load(chain(disable("d", "a"), disable("a", "c"), disable("c", "a"), disable("b", "a")))
        assert rig.disabled_collisions == pairs("ab", "ac", "ad")
        assert dict(rig.ignored) == {}
        assert art.load(chain()).disabled_collisions == ()

    def test_all_elements_of_srdf_may_stand_there(self):
        rig = art.load(chain(enable("b", "d"), default("b")))
        assert rig.disabled_collisions == pairs("ab", "bc")
        assert dict(rig.ignored) == {}

    def test_unknown_links_are_skipped_and_named_with_their_lines(self):
        text = chain(disable("a", "arm"), disable("a", "b"), default("leg"), disable("arm", "hand"))
        expected = (
            r"<text>:11: <disable_default_collisions>: no such links, skipped: 'leg' \(line 11\), 'arm' \(line 9\), 'hand' \(line 12\); "
            "are their names spelt right"
        )
        with pytest.warns(art.RigWarning, match=expected) as told:
            rig = art.load(text)
        assert len(told) == 1
        assert rig.disabled_collisions == pairs("ab")

    def test_a_link_with_itself(self):
        with pytest.warns(
            art.RigWarning, match="<text>:9: <disable_collisions>: names link 'a' twice, ignored; shapes of one link"
        ):
            assert art.load(chain(disable("a", "a"))).disabled_collisions == ()

    @pytest.mark.parametrize(
        ("line", "message"),
        [
            ('<disable_collisions link2="a"/>', '<text>:9: <disable_collisions>: has no link1; add link1="…"'),
            ('<disable_collisions link1="a"/>', '<text>:9: <disable_collisions>: has no link2; add link2="…"'),
            ('<disable_collisions link1="a" link2=" "/>', '<text>:9: <disable_collisions>: has no link2; add link2="…"'),
            ('<enable_collisions link1="a"/>', '<text>:9: <enable_collisions>: has no link2; add link2="…"'),
            ("<disable_default_collisions/>", '<text>:9: <disable_default_collisions>: has no link; add link="…"'),
        ],
    )
    def test_missing_attributes(self, line, message):
        with pytest.raises(art.RigError) as error:
            art.load(chain(line))
        assert str(error.value) == message


class TestSrdf:
    def test_adds_to_the_urdf(self):
        rig = art.load(chain(disable("a", "b")), srdf=srdf(disable("d", "b")))
        assert rig.disabled_collisions == pairs("ab", "bd")

    def test_a_link_with_all_others(self):
        assert art.load(chain(), srdf=srdf(default("b"))).disabled_collisions == pairs("ab", "bc", "bd")

    def test_order_is_default_enable_disable(self):
        """As MoveIt's AllowedCollisionMatrix is made of an SRDF, wherever the elements stand."""
        lines = [disable("b", "c"), enable("b", "c"), enable("d", "b"), default("b")]
        for order in (lines, lines[::-1]):
            assert art.load(chain(), srdf=srdf(*order)).disabled_collisions == pairs("ab", "bc")

    def test_takes_pairs_of_the_urdf_out(self):
        rig = art.load(chain(disable("a", "b"), disable("a", "c")), srdf=srdf(enable("b", "a")))
        assert rig.disabled_collisions == pairs("ac")

    def test_by_path_text_and_bytes(self, tmp_path):
        text = '<?xml version="1.0"?>' + srdf(disable("a", "c"))
        (tmp_path / "chain.srdf").write_text(text)
        for given in (tmp_path / "chain.srdf", str(tmp_path / "chain.srdf"), text, "\ufeff\n" + text, text.encode()):
            assert art.load(chain(), srdf=given).disabled_collisions == pairs("ac")

    def test_elements_of_planners_are_passed_over_and_strange_ones_named(self):
        planner = '<group name="arm"><link name="a"/></group><group_state name="home" group="arm"/><end_effector name="hand"/>'
        rig = art.load(chain(), srdf=srdf(planner, disable("a", "b")))
        assert rig.disabled_collisions == pairs("ab")
        assert dict(rig.ignored) == {}
        with pytest.warns(
            art.RigWarning, match=r"<srdf>:2: <disable_colisions>: unknown element, ignored \(2 in all\); is its name"
        ):
            art.load(chain(), srdf=srdf(*[disable("a", "b").replace("coll", "col")] * 2))

    def test_unknown_links_of_two_documents(self, tmp_path):
        (tmp_path / "other.srdf").write_text(srdf(disable("a", "x"), disable("b", "a")))
        with pytest.warns(art.RigWarning) as told:
            rig = art.load(chain(disable("a", "y")), srdf=tmp_path / "other.srdf")
        one, other = (str(warning.message) for warning in told)
        assert one.startswith("<text>:9: <disable_collisions>: no such links, skipped: 'y' (line 9);")
        assert other.startswith(f"{tmp_path / 'other.srdf'}:2: <disable_collisions>: no such links, skipped: 'x' (line 2);")
        assert told[0].filename == __file__
        assert rig.disabled_collisions == pairs("ab")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("<srdf/>", "<srdf>:1: <srdf>: is not an SRDF; its root element must be <robot>"),
            ("<robot><disable_collisions/>", "<srdf>:1: is not well-formed XML"),
            (srdf('<disable_collisions link1="a"/>'), '<srdf>:2: <disable_collisions>: has no link2; add link2="…"'),
            (
                '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:hand/></robot>',
                "<srdf>:1: <xacro:hand>: is a macro, not SRDF; expand the file with xacro first",
            ),
            ('<!DOCTYPE r [<!ENTITY a "x">]><robot/>', "<srdf>: DOCTYPE: declares entities"),
            (b"", "<srdf>: is empty; give an SRDF document"),
            ("", "'': is not a path; give a path or SRDF text"),
            ("nowhere.srdf", "nowhere.srdf: no such file; check the path"),
            ("/", "/: is a directory; name the SRDF file in it"),
            ("/dev/null", "/dev/null: is not a regular file; name an SRDF file"),
            (
                "package://nowhere/x.srdf",
                "package://nowhere/x.srdf: is in no known package; set ROS_PACKAGE_PATH or give mesh_dirs",
            ),
        ],
    )
    def test_errors(self, text, message):
        with pytest.raises(art.RigError) as error:
            art.load(chain(), srdf=text)
        assert str(error.value).startswith(message)
        assert "articulated rigs" not in str(error.value)


class TestPython:
    def build(self, *rules: tuple, root: str = "fixed") -> art.Rig:
        builder = art.RigBuilder("chain")
        for name, *links in rules:  # before the links that they name
            getattr(builder, name)(*links)
        for name in CHAIN:
            builder.link(name, 1.0, inertia=(1, 1, 1))
        for parent, child in pairwise(CHAIN):
            builder.joint(f"to_{child}", "continuous", parent, child)
        return builder.build(root)

    def test_the_last_word_counts(self):
        assert self.build(("disable_collisions", "c", "a")).disabled_collisions == pairs("ac")
        assert self.build(("disable_collisions", "c")).disabled_collisions == pairs("ac", "bc", "cd")
        disabled, enabled = ("disable_collisions", "c", "a"), ("enable_collisions", "a", "c")
        assert self.build(disabled, enabled).disabled_collisions == ()
        assert self.build(enabled, disabled).disabled_collisions == pairs("ac")
        assert self.build(("disable_collisions", "a"), ("enable_collisions", "b")).disabled_collisions == pairs("ac", "ad")

    def test_unknown_links(self):
        expected = "rig 'chain': disable_collisions: no such links, skipped: 'x', 'y'; are their names spelt right"
        with pytest.warns(art.RigWarning, match=expected):
            rig = self.build(("disable_collisions", "a", "x"), ("disable_collisions", "y"), ("disable_collisions", "a", "b"))
        assert rig.disabled_collisions == pairs("ab")


class TestWhereARigGoes:
    def rig(self, root: str = "fixed") -> art.Rig:
        return art.load(chain(disable("a", "c"), disable("b", "d")), root)

    @pytest.mark.parametrize("root", ["fixed", "free"])
    def test_written_and_read_again(self, root):
        rig = self.rig(root)
        text = rig.to_urdf()
        assert text.count('<disable_collisions link1="') == 2
        assert art.load(text, root).disabled_collisions == rig.disabled_collisions == pairs("ac", "bd")

    def test_other_joint_properties(self):
        assert self.rig().with_joints(damping=1.0).disabled_collisions == pairs("ac", "bd")

    def test_composed(self):
        both = art.compose(x=self.rig("free"), y=self.rig(), ball=art.loose_body(art.Sphere(0.1)))
        expected = (("x/a", "x/c"), ("x/b", "x/d"), ("y/a", "y/c"), ("y/b", "y/d"))
        assert both.disabled_collisions == expected
        assert art.load(both.to_urdf()).disabled_collisions == expected
        twice = art.compose(z=both)
        assert twice.disabled_collisions == tuple((f"z/{a}", f"z/{b}") for a, b in expected)

    def test_saved_with_a_trajectory(self, tmp_path):
        run = art.simulate(self.rig(), duration=0.02, dt=0.01)
        run.save(tmp_path / "run.npz")
        assert art.Trajectory.load(tmp_path / "run.npz").rig.disabled_collisions == pairs("ac", "bd")


ROBOTS = {
    "talos_data/robots/talos_full_v2.urdf": "talos_data/srdf/talos.srdf",
    "panda_description/urdf/panda.urdf": "panda_description/srdf/panda.srdf",
    "solo_description/robots/solo12.urdf": "solo_description/srdf/solo.srdf",
    "hyq_description/robots/hyq_no_sensors.urdf": "hyq_description/srdf/hyq.srdf",
    "anymal_c_simple_description/urdf/anymal.urdf": "anymal_c_simple_description/srdf/anymal.srdf",
    "ur_description/urdf/ur5_robot.urdf": "ur_description/srdf/ur5.srdf",
    "go1_description/urdf/go1.urdf": "go1_description/srdf/go1.srdf",
}


class TestExampleRobots:
    @pytest.mark.parametrize("urdf", ROBOTS)
    def test_as_many_pairs_as_the_file_names(self, robots, urdf):
        """Counted with nothing but lxml."""
        path = robots / ROBOTS[urdf]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", art.RigWarning)
            rig = art.load(robots / urdf, srdf=path)
            named = [
                (element.get("link1"), element.get("link2"))
                for element in etree.parse(path).getroot().iter("disable_collisions")
            ]
            known = {frozenset(pair) for pair in named if set(pair) <= set(rig.links)}
            assert {frozenset(pair) for pair in rig.disabled_collisions} == known
            assert len(rig.disabled_collisions) == len(known) > 5
            assert art.load(rig.to_urdf()).disabled_collisions == rig.disabled_collisions

    def test_as_pinocchio_reads_them(self, robots):
        """The pairs of geometries that it takes away are those of the pairs of links here."""
        pin = pytest.importorskip("pinocchio")
        urdf, path = robots / "talos_data/robots/talos_full_v2.urdf", robots / "talos_data/srdf/talos.srdf"
        model = pin.buildModelFromUrdf(str(urdf))
        shapes = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION, package_dirs=[str(robots.parents[1])])
        shapes.addAllCollisionPairs()
        before = {(pair.first, pair.second) for pair in shapes.collisionPairs}
        pin.removeCollisionPairs(model, shapes, str(path))
        gone = before - {(pair.first, pair.second) for pair in shapes.collisionPairs}
        links = [model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", art.RigWarning)
            rig = art.load(urdf, srdf=path)
        disabled = {frozenset(pair) for pair in rig.disabled_collisions}
        expected = {(i, j) for i, j in before if frozenset((links[i], links[j])) in disabled}
        assert gone == expected
        assert len(gone) > 100
