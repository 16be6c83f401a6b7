"""Every function of dynamics against Pinocchio: on every robot of example-robot-data, and on random trees."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROBOTS
from random_trees import random_rig

import articulated as art
from articulated.crosscheck import PinocchioModel, compare
from articulated.rig.load import read

REFUSED = {
    "alex_description/urdf/alex_psyonic_hands.urdf",
    "romeo_description/urdf/romeo.urdf",
    "romeo_description/urdf/romeo_laas_small.urdf",
    "romeo_description/urdf/romeo_small.urdf",
    "ur_description/urdf/ur3.urdf",
}
"""Rigs that do not load; tests/rig/test_example_robots.py says why."""

EVERY_FUNCTION = {
    "forward_dynamics",
    "forward_dynamics, external",
    "inverse_dynamics",
    "inverse_dynamics, external",
    "mass_matrix",
    "bias_forces",
    "gravity_forces",
    "link_poses",
    "link_velocities",
    "jacobian",
    "jacobian, point",
    "center_of_mass",
    "momentum",
    "kinetic_energy",
    "potential_energy",
    "integrate",
    "difference",
}


def assert_agrees(reference: PinocchioModel, samples: int = 20) -> None:
    comparisons = compare(reference, samples)
    assert {one.function for one in comparisons} >= EVERY_FUNCTION - {"center_of_mass", "momentum"}
    assert not [one for one in comparisons if not one.agrees]


@pytest.mark.sweep
@pytest.mark.parametrize("root", ["fixed", "free"])
@pytest.mark.parametrize("robot", [robot for robot in ROBOTS if robot not in REFUSED])
def test_example_robot(interpreted, robots, robot, root):
    # Pinocchio reads the same file with its own reader, so readers are compared too
    rig = art.load(robots / robot, root)
    assert_agrees(PinocchioModel.from_urdf(rig, (robots / robot).read_text()))


@pytest.mark.parametrize("robot", ["ur_description/urdf/ur5_robot.urdf", "solo_description/robots/solo12.urdf"])
@pytest.mark.parametrize("root", ["fixed", "free", "planar"])
def test_roots(robots, robot, root):
    rig = art.load(robots / robot, root)
    assert_agrees(PinocchioModel.from_urdf(rig, (robots / robot).read_text()), samples=5)


@pytest.mark.parametrize(
    "robot", sorted(REFUSED - {"ur_description/urdf/ur3.urdf", "alex_description/urdf/alex_psyonic_hands.urdf"})
)
def test_repaired_robot(interpreted, robots, robot):
    # massless fingers remain without mass however their inertia is repaired: they are given rotors
    builder = read(robots / robot)
    builder._joints = [one if one.kind == "fixed" else with_rotor(one) for one in builder._joints]
    assert_agrees(PinocchioModel.from_rig(builder.build("free", repair_inertia=True)), samples=5)


def with_rotor(joint):
    from dataclasses import replace

    return replace(joint, armature=0.01)


@pytest.mark.sweep
@pytest.mark.parametrize("block", range(30))
def test_random_trees(interpreted, block):
    for seed in range(10 * block, 10 * block + 10):
        assert_agrees(PinocchioModel.from_rig(random_rig(seed)))


@pytest.mark.parametrize("seed", range(1000, 1012))
def test_random_trees_with_followers_and_armature(interpreted, seed):
    rig = random_rig(seed, mimic=True, armature=True, size=10)
    assert_agrees(PinocchioModel.from_rig(rig), samples=5)


def test_a_wrong_mass_is_noticed():
    rig, other = (build_pendulum(mass) for mass in (1.0, 1.0 + 1e-8))
    reference = PinocchioModel.from_rig(other)
    reference.rig = rig
    failed = {one.function for one in compare(reference, 5) if not one.agrees}
    assert {"forward_dynamics", "mass_matrix", "kinetic_energy"} <= failed


def build_pendulum(mass: float) -> art.Rig:
    builder = art.RigBuilder("pendulum")
    builder.link("base")
    builder.link("bob", mass, (0.3, 0.1, -1.0), (0.01, 0.02, 0.03))
    builder.joint("hinge", "revolute", "base", "bob", axis=(0.0, 1.0, 0.2))
    return builder.build()


def test_coordinates_survive_the_conversion():
    rig = random_rig(4)
    reference = PinocchioModel.from_rig(rig)
    v = np.random.default_rng(0).normal(size=rig.nv)
    np.testing.assert_allclose(reference.tau(reference.v(v)), v)
