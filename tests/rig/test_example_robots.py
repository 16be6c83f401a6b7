"""Every URDF of the example-robot-data wheel loads, or is refused for a reason that its author would accept."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from conftest import ROBOTS

import articulated as art

REFUSED = {
    # follows "index_q1"; the joint is called "Left_index_q1"
    "alex_description/urdf/alex_psyonic_hands.urdf": r"urdf:1030: joint 'Left_index_q2': follows joint 'index_q1', which does not exist",
    # RHand drives only fingers that have no mass
    "romeo_description/urdf/romeo.urdf": r"urdf:1451: joint 'RHand': moves no mass: link 'RFinger11Link' .* have none",
    # principal moments of the pelvis: -0.021, 0.052, 0.099
    "romeo_description/urdf/romeo_laas_small.urdf": {
        "fixed": r"urdf:235: link 'LShoulderYaw_link': inertia violates the triangle inequality by 0\.183 %",
        "free": r"urdf:327: link 'body': inertia has a negative principal moment",
    },
    # principal moments of the shoulder: 0.0007, 0.0007, 0.0066
    "romeo_description/urdf/romeo_small.urdf": r"urdf:547: link 'RShoulderYawLink': inertia violates the triangle inequality by 79\.6 %",
    # an unfilled xacro: <robot/> with nothing in it
    "ur_description/urdf/ur3.urdf": r"ur3\.urdf:6: <robot>: has no links; a rig needs one at least",
}


@pytest.mark.parametrize("root", ["fixed", "free"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_loads_or_is_refused_with_reason(robots, robot, root):
    expected = REFUSED.get(robot)
    if expected is None:
        rig = art.load(robots / robot, root)
        assert rig.nv >= (6 if root == "free" else 0)
        assert np.isfinite(rig.mass)
        return
    with pytest.raises(art.RigError, match=expected if isinstance(expected, str) else expected[root]) as refused:
        art.load(robots / robot, root)
    assert refused.value.remedy
    assert refused.value.source.endswith(robot)


def test_there_are_69():
    assert len(ROBOTS) == 69
    assert set(REFUSED) <= set(ROBOTS)


def test_meshes_are_found_where_the_wheel_puts_them(robots):
    with warnings.catch_warnings():
        warnings.simplefilter("error", art.RigWarning)
        rig = art.load("package://example-robot-data/robots/human_description/robots/human.urdf")
    mesh = rig.links["middle_pelvis"].visuals[0].geometry
    assert isinstance(mesh, art.Mesh)
    assert mesh.path is not None
    assert mesh.path.is_file()


@pytest.mark.parametrize("robot", [robot for robot in ROBOTS if robot not in REFUSED])
def test_survives_being_written_and_read(robots, robot):
    rig = art.load(robots / robot, "free")
    again = art.load(rig.to_urdf(), "free")
    assert list(again.joints) == list(rig.joints)
    assert list(again.links) == list(rig.links)
    assert list(again.fixed_joints) == list(rig.fixed_joints)
    for old, new in zip(rig.bodies, again.bodies, strict=True):
        np.testing.assert_allclose(new.pose, old.pose, atol=1e-13)
        np.testing.assert_allclose(new.inertia, old.inertia, atol=1e-13)
        assert new.mass == pytest.approx(old.mass)
    for old, new in zip(rig.joints.values(), again.joints.values(), strict=True):
        assert new.limits == old.limits
        assert (new.damping, new.friction, new.armature, new.mimic) == (old.damping, old.friction, old.armature, old.mimic)
    for old, new in zip(rig.links.values(), again.links.values(), strict=True):
        np.testing.assert_allclose(new.pose, old.pose, atol=1e-13)
        assert len(new.collisions) == len(old.collisions)
        assert [shape.geometry for shape in new.collisions if not isinstance(shape.geometry, art.Mesh)] == [
            shape.geometry for shape in old.collisions if not isinstance(shape.geometry, art.Mesh)
        ]


def test_refusals_name_a_line_of_the_element(robots):
    for robot, expected in REFUSED.items():
        pattern = expected if isinstance(expected, str) else expected["fixed"]
        if found := re.search(r"urdf:(\d+): (link|joint) '([^']+)'", pattern):
            line = (robots / robot).read_text().splitlines()[int(found[1]) - 1]
            assert f'name="{found[3]}"' in line
