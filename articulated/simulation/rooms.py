"""How much room joints have before their stops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.dynamics.mechanism import TreeJoint
from articulated.dynamics.swing_twist import stops_of
from articulated.scalar import Scalar, sqrt
from articulated.simulation.scene import Scene
from articulated.spatial.rotation import quaternion_log

_TINY = 1e-20


@dataclass(frozen=True, eq=False)
class Room:
    """How far a joint is from its stops.

    Attributes:
        direction: in which its coordinates move towards or from them: a speed is Σ c_s v_s.
        ends: the sign of the direction in which each stop pushes, and the room left before it [rad or m].
        w: how much velocity an impulse gives [1/kg or 1/(kg m²)].
    """

    direction: dict[int, Scalar]
    ends: tuple[tuple[float, Scalar], ...]
    w: float


def rooms(scene: Scene, q: Sequence[Scalar]) -> list[Room]:
    """Of all stops, coordinates' before ball joints'."""
    lower, upper = scene.rig.lower, scene.rig.upper
    at = {s: k for j in scene.mechanism.own_joints() if len(j.q) == len(j.v) for s, k in zip(j.v, j.q, strict=True)}
    found = []
    for s in scene.stopped:
        ends = (1.0, q[at[s]] - float(lower[s])), (-1.0, float(upper[s]) - q[at[s]])
        found.append(Room({s: 1.0}, ends, scene.joint_felt([s])))
    for joint in scene.cones:
        found += _of_ball(scene, joint, joint.configuration(q))
    return found


def _of_ball(scene: Scene, joint: TreeJoint, quat_xyzw: Sequence[Scalar]) -> list[Room]:
    limits = scene.rig.joints[joint.name].limits
    if limits.ball is not None:
        stops = stops_of(limits.ball, quat_xyzw)
    else:
        turn = quaternion_log(quat_xyzw)
        angle = sqrt(turn.dot(turn) + _TINY)
        stops = [(turn * (1.0 / angle), ((-1.0, limits.upper - angle),))]
    felt = scene.joint_felt(joint.v)
    return [Room(dict(zip(joint.v, direction, strict=True)), ends, felt) for direction, ends in stops]
