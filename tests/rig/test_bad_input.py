"""What is wrong with a rig is said with file, line, element, reason and remedy."""

from __future__ import annotations

import os
import pickle
import re

import pytest

import articulated as art

LINK = '<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
BASE, ARM = LINK.format(name="base"), LINK.format(name="arm")
JOINT = '<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>{}<limit lower="-1" upper="1"/></joint>'
HINGE = JOINT.format('<axis xyz="0 0 1"/>')


def robot(*lines: str) -> str:
    """A URDF whose first line is <robot>, and then one line for each argument."""
    return "\n".join(['<robot name="r">', *lines, "</robot>"])


def joint(inside: str = "", kind: str = "revolute", name: str = "hinge", parent: str = "base", child: str = "arm") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def arm(inertial: str) -> str:
    return f'<link name="arm"><inertial>{inertial}</inertial></link>'


def inertia(**changes: str) -> str:
    moments = {"ixx": "1", "ixy": "0", "ixz": "0", "iyy": "1", "iyz": "0", "izz": "1"} | changes
    return "<inertia " + " ".join(f'{key}="{value}"' for key, value in moments.items()) + "/>"


MASS = '<mass value="1"/>'
LIMIT = '<limit lower="-1" upper="1"/>'

REFUSED = {
    # the document
    "broken XML": (robot(BASE, "<link"), r"<text>:\d+: is not well-formed XML"),
    "unclosed element": (robot(BASE).replace("</robot>", ""), r"is not well-formed XML"),
    "not a URDF": ('<sdf version="1.9"/>', r"<text>:1: <sdf>: is not a URDF; its root element must be <robot>"),
    "entity expansion": (
        '<!DOCTYPE r [<!ENTITY a "x"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"><link name="l"/></robot>',
        r"DOCTYPE: declares entities|uses XML entities",
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="r"><link name="l">&a;</link></robot>',
        r"DOCTYPE: declares entities",
    ),
    "external document type": ('<!DOCTYPE r SYSTEM "r.dtd"><robot name="r"/>', r"DOCTYPE: declares .* external"),
    "unexpanded xacro": (
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n<xacro:include filename="x"/></robot>',
        r"<text>:2: <xacro:include>: is a macro, not URDF; expand the file with xacro",
    ),
    "no links": (robot(), r"<text>:1: <robot>: has no links"),
    # names
    "link without a name": (robot("<link/>"), r"<text>:2: <link>: has no name"),
    "joint without a name": (robot(BASE, ARM, '<joint type="fixed"/>'), r"<text>:4: <joint>: has no name"),
    "doubled link": (robot(BASE, BASE), r"<text>:3: link 'base': 2 links have this name; rename"),
    "doubled joint": (robot(BASE, ARM, HINGE, HINGE), r"<text>:5: joint 'hinge': 2 joints have this name"),
    # the tree
    "two roots": (robot(BASE, ARM), r"<text>:3: link 'arm': the rig has 2 root links: 'base', 'arm'"),
    "no root": (
        robot(BASE, ARM, joint(LIMIT), joint(LIMIT, name="back", parent="arm", child="base")),
        r"has no root link: its joints form a loop",
    ),
    "a loop beside the tree": (
        robot(
            BASE,
            ARM,
            LINK.format(name="c"),
            joint(LIMIT, parent="arm", child="c"),
            joint(LIMIT, name="back", parent="c", child="arm"),
        ),
        r"<text>:\d: joint '(hinge|back)': closes a loop of links: .*art\.Loop",
    ),
    "two parents": (
        robot(BASE, LINK.format(name="b2"), ARM, joint(LIMIT), joint(LIMIT, name="other", parent="b2")),
        r"<text>:6: joint 'other': link 'arm' already hangs by joint 'hinge'",
    ),
    "unknown parent": (
        robot(BASE, ARM, joint(LIMIT, parent="bass")),
        r"<text>:4: joint 'hinge': its parent link 'bass' does not",
    ),
    "unknown child": (robot(BASE, ARM, joint(LIMIT, child="leg")), r"its child link 'leg' does not exist"),
    "joint to itself": (robot(BASE, ARM, joint(LIMIT, child="base")), r"joint 'hinge': joins link 'base' to itself"),
    "joint without parent": (
        robot(BASE, ARM, '<joint name="hinge" type="fixed"><child link="arm"/></joint>'),
        r"<text>:4: joint 'hinge': has no <parent>",
    ),
    "joint without child": (
        robot(BASE, ARM, '<joint name="hinge" type="fixed"><parent link="base"/></joint>'),
        r"joint 'hinge': has no <child>",
    ),
    "parent without link": (
        robot(BASE, ARM, '<joint name="hinge" type="fixed"><parent/><child link="arm"/></joint>'),
        r"joint 'hinge', <parent>: has no link",
    ),
    # joints
    "joint without type": (
        robot(BASE, ARM, '<joint name="hinge"><parent link="base"/><child link="arm"/></joint>'),
        r"<text>:4: joint 'hinge': has no type",
    ),
    "unknown joint type": (
        robot(BASE, ARM, joint(kind="screw")),
        r"<text>:4: joint 'hinge': unknown joint type 'screw'; use one of fixed, revolute",
    ),
    "zero axis": (robot(BASE, ARM, joint('<axis xyz="0 0 0"/>' + LIMIT)), r"<text>:4: joint 'hinge': axis is the zero vector"),
    "axis of two numbers": (robot(BASE, ARM, joint('<axis xyz="0 1"/>' + LIMIT)), r"<axis>: xyz is '0 1'; give 3 numbers"),
    "axis of words": (robot(BASE, ARM, joint('<axis xyz="a b c"/>' + LIMIT)), r"<axis>: xyz is 'a b c'; give 3 numbers"),
    "decimal comma": (
        robot(BASE, ARM, joint('<axis xyz="0 0,5 1"/>' + LIMIT)),
        r"xyz is '0 0,5 1'; .* with a point for decimals",
    ),
    "two axes": (
        robot(BASE, ARM, joint("<axis xyz='1 0 0'/><axis xyz='0 1 0'/>" + LIMIT)),
        r"<axis>: stands 2 times; keep one",
    ),
    "universal without second axis": (robot(BASE, ARM, joint(kind="universal")), r"needs a second axis; give <axis2"),
    "universal with parallel axes": (
        robot(BASE, ARM, joint('<axis xyz="0 0 1"/><axis2 xyz="0 0 -1"/>', kind="universal")),
        r"its two axes are parallel",
    ),
    "second axis elsewhere": (robot(BASE, ARM, joint('<axis2 xyz="0 0 1"/>' + LIMIT)), r"a revolute joint has no second axis"),
    "crossed limits": (
        robot(BASE, ARM, joint('<limit lower="2" upper="1"/>')),
        r"joint 'hinge': lower limit 2 is not below upper limit 1",
    ),
    "limit that is no number": (
        robot(BASE, ARM, joint('<limit lower="low" upper="1"/>')),
        r"<limit>: lower is 'low'; give a number",
    ),
    "negative velocity limit": (robot(BASE, ARM, joint('<limit lower="0" upper="1" velocity="-1"/>')), r"velocity limit is -1"),
    "negative damping": (robot(BASE, ARM, joint('<dynamics damping="-1"/>' + LIMIT)), r"damping is -1; give a finite number"),
    "infinite friction": (
        robot(BASE, ARM, joint('<dynamics friction="inf"/>' + LIMIT)),
        r"friction is 'inf'; give finite numbers",
    ),
    "negative armature": (robot(BASE, ARM, joint('<dynamics armature="-1"/>' + LIMIT)), r"armature is -1"),
    "rpy and quaternion": (
        robot(BASE, ARM, joint('<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>' + LIMIT)),
        r"<origin>: gives both rpy and quat_xyzw",
    ),
    "quaternion that is not of unit length": (
        robot(BASE, ARM, joint('<origin quat_xyzw="0 0 0 2"/>' + LIMIT)),
        r"<origin>: quat_xyzw is \[0.0, 0.0, 0.0, 2.0\]; give a unit quaternion",
    ),
    "NaN in an origin": (robot(BASE, ARM, joint('<origin xyz="0 nan 0"/>' + LIMIT)), r"xyz is '0 nan 0'; give finite numbers"),
    # followers
    "dangling mimic": (
        robot(BASE, ARM, joint('<mimic joint="ghost"/>' + LIMIT)),
        r"joint 'hinge': follows joint 'ghost', which does not exist",
    ),
    "mimic of itself": (robot(BASE, ARM, joint('<mimic joint="hinge"/>' + LIMIT)), r"follows itself: hinge -> hinge"),
    "mimic circle": (
        robot(
            BASE,
            ARM,
            LINK.format(name="hand"),
            joint('<mimic joint="wrist"/>' + LIMIT),
            joint('<mimic joint="hinge"/>' + LIMIT, name="wrist", parent="arm", child="hand"),
        ),
        r"<text>:5: joint 'hinge': follows itself: hinge -> wrist -> hinge",
    ),
    "mimic of a ball": (
        robot(
            BASE,
            ARM,
            LINK.format(name="hand"),
            joint(kind="ball"),
            joint('<mimic joint="hinge"/>' + LIMIT, name="wrist", parent="arm", child="hand"),
        ),
        r"joint 'wrist': follows joint 'hinge', which is ball",
    ),
    "ball that follows": (robot(BASE, ARM, joint('<mimic joint="x"/>', kind="ball")), r"a ball joint cannot follow another"),
    "mimic without joint": (robot(BASE, ARM, joint("<mimic/>" + LIMIT)), r"<mimic>: has no joint"),
    "mimic with multiplier 0": (robot(BASE, ARM, joint('<mimic joint="x" multiplier="0"/>' + LIMIT)), r"mimic multiplier is 0"),
    # masses
    "negative mass": (
        robot(BASE, arm('<mass value="-1"/>' + inertia()), HINGE),
        r"<text>:3: link 'arm': mass is -1; give a positive",
    ),
    "NaN mass": (robot(BASE, arm('<mass value="nan"/>' + inertia()), HINGE), r"<mass>: value is 'nan'; give finite numbers"),
    "no mass": (robot(BASE, arm(inertia()), HINGE), r"link 'arm', <inertial>: has no <mass>"),
    "no inertia": (robot(BASE, arm(MASS), HINGE), r"link 'arm', <inertial>: has no <inertia>"),
    "half an inertia": (robot(BASE, arm(MASS + '<inertia ixx="1"/>'), HINGE), r"<inertia>: has no ixy"),
    "triangle inequality": (
        robot(BASE, arm(MASS + inertia(izz="3")), HINGE),
        r"link 'arm': inertia violates the triangle inequality by 33.3 %; .*repair_inertia=True",
    ),
    "negative moment": (
        robot(BASE, arm(MASS + inertia(ixx="-1")), HINGE),
        r"link 'arm': inertia has a negative principal moment",
    ),
    "massless leaf": (robot(BASE, '<link name="arm"/>', HINGE), r"joint 'hinge': moves no mass: link 'arm' .* have none"),
    "point mass on the axis": (
        robot(BASE, arm('<origin xyz="0 0 1"/>' + MASS + inertia(ixx="0", iyy="0", izz="0")), HINGE),
        r"joint 'hinge': moves no mass: link 'arm' and what hangs from it do not resist it",
    ),
    "two joints on one axis": (
        robot(
            BASE,
            '<link name="gear"/>',
            ARM,
            joint('<axis xyz="0 0 1"/>' + LIMIT, child="gear"),
            joint('<axis xyz="0 0 1"/><origin xyz="0 0 1"/>' + LIMIT, name="second", parent="gear"),
        ),
        r"joint 'hinge': moves no mass",
    ),
    # shapes
    "empty geometry": (
        robot('<link name="l"><collision><geometry/></collision></link>'),
        r"<geometry>: holds nothing; give one of",
    ),
    "no geometry": (robot('<link name="l"><visual/></link>'), r"<visual>: has no <geometry>"),
    "unknown geometry": (
        robot('<link name="l"><collision><geometry><torus/></geometry></collision></link>'),
        r"<geometry>: holds torus; give one of sphere, box, cylinder, capsule, mesh",
    ),
    "negative radius": (
        robot('<link name="l"><collision><geometry><sphere radius="-1"/></geometry></collision></link>'),
        r"link 'l': sphere has size \(-1.0,\); give positive lengths",
    ),
    "mesh outside its package": (
        robot('<link name="l"><visual><geometry><mesh filename="package://p/../../etc/passwd"/></geometry></visual></link>'),
        r"leaves its package; name a file inside the package",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_refused(kind):
    text, expected = REFUSED[kind]
    with pytest.raises(art.RigError, match=expected) as error:
        art.load(text)
    assert error.value.remedy, "an error says what to do"


def test_there_are_fifty_kinds():
    assert len(REFUSED) >= 50


WARNED = {
    "millimetres": (robot(BASE, ARM, joint('<origin xyz="0 0 300"/>' + LIMIT)), r"lies 300 m from its parent; .*millimetres"),
    "centre of mass in millimetres": (
        robot(BASE, arm('<origin xyz="0 0 120"/>' + MASS + inertia()), HINGE),
        r"1 kg is spread over more than 50 m",
    ),
    "inertia in kg mm²": (
        robot(BASE, arm(MASS + inertia(ixx="9000", iyy="9000", izz="9000")), HINGE),
        r"link 'arm': 1 kg is spread over more than 50 m; units are",
    ),
    "shape in millimetres": (
        robot('<link name="l"><collision><geometry><box size="100 200 300"/></geometry></collision></link>'),
        r"box is 300 m large; .*millimetres",
    ),
    "degrees": (robot(BASE, ARM, joint('<limit lower="-90" upper="90"/>')), r"may turn by 90 rad; .*degrees"),
    "no limits": (robot(BASE, ARM, joint()), r"joint 'hinge': has no <limit>; it may move without end"),
    "empty limits": (robot(BASE, ARM, joint('<limit effort="1"/>')), r"gives no lower and upper limit; read as unlimited"),
    "limits 0 and 0": (robot(BASE, ARM, joint('<limit lower="0" upper="0"/>')), r"lower and upper limit are both 0"),
    "misspelt element": (robot(BASE, ARM, joint('<limits lower="0"/>' + LIMIT)), r"<limits>: unknown element, ignored"),
    "missing mesh": (
        robot('<link name="l"><visual><geometry><mesh filename="gone.stl"/></geometry></visual></link>'),
        r"mesh files not found: gone.stl; name their directories in mesh_dirs",
    ),
    "later version": (
        robot(BASE).replace('name="r"', 'name="r" version="2.0"'),
        r"is URDF version 2.0; versions 1.0 to 1.2 are known",
    ),
    "fixed joint that follows": (
        robot(BASE, ARM, joint('<mimic joint="x"/>', kind="fixed")),
        r"is fixed and cannot follow another joint; its mimic is ignored",
    ),
    "impossible inertia of the base": (
        robot(BASE.replace('izz="1"', 'izz="9"'), ARM, HINGE),
        r"link 'base': inertia violates .* does not move, so nothing depends on it",
    ),
    "inertia without mass": (
        robot(
            BASE,
            ARM,
            HINGE,
            arm('<mass value="0"/>' + inertia()).replace("arm", "pad"),
            joint(kind="fixed", name="f", child="pad"),
        ),
        r"link 'pad': has a rotational inertia but no mass",
    ),
}


@pytest.mark.parametrize("kind", WARNED)
def test_warned_of(kind):
    text, expected = WARNED[kind]
    with pytest.warns(art.RigWarning, match=expected):
        art.load(text)


def test_a_good_rig_is_not_warned_of(recwarn):
    assert art.load(robot(BASE, ARM, HINGE)).nv == 1
    assert not recwarn.list


def test_a_warning_points_at_the_caller():
    with pytest.warns(art.RigWarning) as caught:
        art.load(WARNED["no limits"][0])
    assert caught[0].filename == __file__


def test_repair_is_on_request():
    text, _ = REFUSED["triangle inequality"]
    rig = art.load(text, repair_inertia=True)
    assert rig.links["arm"].inertia.diagonal() == pytest.approx([1.5, 1.5, 3.0])


def test_no_such_file():
    with pytest.raises(art.RigError, match=r"nowhere\.urdf: no such file; .*articulated rigs"):
        art.load("nowhere.urdf")


def test_a_misspelt_shipped_rig():
    with pytest.raises(art.RigError, match=r"ragdol: no such file; did you mean the shipped rig 'ragdoll'\?"):
        art.load("ragdol")


def test_directory(tmp_path):
    with pytest.raises(art.RigError, match=r"is a directory; name the URDF file in it"):
        art.load(tmp_path)


def test_not_a_regular_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")  # reading it would hang
    with pytest.raises(art.RigError, match=r"is not a regular file"):
        art.load(tmp_path / "pipe")


def test_empty_file(tmp_path):
    (tmp_path / "empty.urdf").touch()
    with pytest.raises(art.RigError, match=r"empty\.urdf: is empty"):
        art.load(tmp_path / "empty.urdf")


def test_huge_file(tmp_path):
    with open(tmp_path / "huge.urdf", "wb") as file:
        file.truncate(100 * 2**20)
    with pytest.raises(art.RigError, match=r"has 100 MiB; at most 64 are read"):
        art.load(tmp_path / "huge.urdf")


def test_binary_file(tmp_path):
    (tmp_path / "mesh.urdf").write_bytes(bytes(range(256)))
    with pytest.raises(art.RigError, match=r"mesh\.urdf:1: is not well-formed XML"):
        art.load(tmp_path / "mesh.urdf")


def test_unreadable_path(tmp_path):
    with pytest.raises(art.RigError, match=r"cannot be read: .*name too long"):
        art.load("x" * 5000)


def test_unknown_package():
    with pytest.raises(art.RigError, match=r"package://no/such.urdf: is in no known package; set ROS_PACKAGE_PATH"):
        art.load("package://no/such.urdf")


def test_empty_name():
    with pytest.raises(art.RigError, match=r"is not a path; give a path, URDF text or a shipped rig's name"):
        art.load("")


def test_unknown_root():
    with pytest.raises(ValueError, match=r"root is 'flying'; expected 'fixed', 'free' or 'planar'"):
        art.load(robot(BASE, ARM, HINGE), "flying")


def test_deep_nesting_is_refused():
    text = "<robot name='r'>" + "<a>" * 5000 + "</a>" * 5000 + "</robot>"
    with pytest.raises(art.RigError, match=r"not well-formed XML: Excessive depth"):
        art.load(text)


def test_errors_survive_pickling():
    with pytest.raises(art.RigError) as caught:
        art.load(robot(BASE, ARM, joint(kind="screw")))
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert (again.line, again.element) == (4, "joint 'hinge'")


def test_ignored_elements_are_counted():
    rig = art.load(robot(BASE, "<gazebo/>", "<gazebo/>", "<transmission/>"))
    assert dict(rig.ignored) == {"gazebo": 2, "transmission": 1}


def test_file_name_and_line_in_a_file(tmp_path):
    (tmp_path / "walker.urdf").write_text(robot(BASE, ARM, joint('<axis xyz="0 0 0"/>' + LIMIT, name="left_knee")))
    expected = r"""walker.urdf:4: joint 'left_knee': axis is the zero vector; give <axis xyz="…"/> a direction"""
    with pytest.raises(art.RigError, match=re.escape(expected)):
        art.load(tmp_path / "walker.urdf")
