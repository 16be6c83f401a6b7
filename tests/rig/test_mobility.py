"""A joint that moves no mass is found at load, and only such a joint."""

from __future__ import annotations

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art

SOLID = (0.1, 0.1, 0.1)


def chain(*links: dict, root: str = "fixed") -> art.Rig:
    """Links in a row, each with its joint's arguments; a link has mass if it says so."""
    builder = art.RigBuilder("chain")
    builder.link("link0", 1.0, inertia=SOLID)
    for k, link in enumerate(links, start=1):
        link = dict(link)
        builder.link(f"link{k}", link.pop("mass", 0.0), link.pop("center", (0, 0, 0)), link.pop("inertia", (0, 0, 0)))
        builder.joint(f"joint{k}", link.pop("kind", "revolute"), f"link{k - 1}", f"link{k}", **link)
    return builder.build(root)


X, Y, Z = {"axis": (1, 0, 0)}, {"axis": (0, 1, 0)}, {"axis": (0, 0, 1)}
BODY = {"mass": 1.0, "inertia": SOLID}


@pytest.mark.parametrize(
    ("links", "culprit"),
    [
        ([Z], "joint1"),
        ([Z, {**X, **BODY}, Y], "joint3"),
        ([X, {**X, **BODY}], "joint1"),  # one axis twice
        ([X, Y, {**Z, **BODY}, Z], "joint4"),
        ([{**Z, "mass": 1.0, "center": (0, 0, 1)}], "joint1"),  # a point on the axis
        ([{"kind": "ball", "mass": 1.0, "center": (0, 0, 1)}], "joint1"),  # a point does not feel a turn about the arm
        ([{"kind": "prismatic", **Z}, {"kind": "prismatic", **Z, **BODY}], "joint1"),
        ([{"kind": "ball"}, {"kind": "ball", **BODY}], "joint1"),  # two balls at one place
        ([X, Y, Z, X, Y, Z, {**X, **BODY}], "joint4"),  # seven joints, one body, one place: the last three suffice
        ([{"kind": "planar", **Z}, {"kind": "prismatic", **X, **BODY}], "joint1"),
    ],
)
def test_refused(links, culprit):
    with pytest.raises(art.RigError, match=rf"joint '{culprit}': moves no mass"):
        chain(*links)


@pytest.mark.parametrize(
    "links",
    [
        [X, Y, {**Z, **BODY}],  # a hip of three hinges
        [{**Z, "mass": 1.0, "center": (1, 0, 0)}],  # a point off the axis
        [X, {**X, **BODY, "xyz": (0, 1, 0)}],  # parallel axes apart
        [{**Z, "armature": 0.1}],
        [{**X, "armature": 0.1}, {**X, **BODY}],
        [{"kind": "universal", "axis": (1, 0, 0), "axis2": (0, 1, 0)}, {**Z, **BODY}],
        [{"kind": "prismatic", **X}, {"kind": "prismatic", **Y}, {"kind": "prismatic", **Z}, {"kind": "ball", **BODY}],
    ],
)
def test_accepted(links):
    rig = chain(*links)
    q = rig.random(0)
    assert np.linalg.eigvalsh(art.mass_matrix(rig, q)).min() > 1e-6


def test_free_root_without_mass_of_its_own():
    builder = art.RigBuilder("frame")
    builder.link("base")
    builder.link("body", 1.0, inertia=SOLID)
    builder.joint("hinge", "revolute", "base", "body")
    with pytest.raises(art.RigError, match="joint 'root_joint': moves no mass"):
        builder.build("free")


def test_leader_of_massless_followers():
    builder = art.RigBuilder("hand")
    builder.link("palm", 1.0, inertia=SOLID)
    for k in range(2):
        builder.link(f"finger{k}")
        builder.joint(f"f{k}", "revolute", "palm", f"finger{k}", mimic=art.Mimic("f0") if k else None)
    with pytest.raises(art.RigError, match="joint 'f0': moves no mass"):
        builder.build()


def test_leader_without_mass_of_a_follower_with_mass():
    builder = art.RigBuilder("hand")
    builder.link("palm", 1.0, inertia=SOLID)
    builder.link("knob")
    builder.link("finger", 1.0, inertia=SOLID)
    builder.joint("knob", "revolute", "palm", "knob")
    builder.joint("finger", "revolute", "palm", "finger", mimic=art.Mimic("knob", 2.0))
    assert art.mass_matrix(builder.build(), [0.0]) == pytest.approx(0.4)


def test_random_trees_are_accepted_and_positive_definite():
    for seed in range(30):
        rig = random_rig(seed, mimic=True)
        M = art.mass_matrix(rig, rig.random(seed))
        assert np.linalg.eigvalsh(M).min() > 0
