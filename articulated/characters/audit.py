"""What is wrong with a motion, before a character is asked to do it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from articulated.characters.ground import lowest
from articulated.dynamics.functions import difference, inverse_dynamics, link_velocities
from articulated.trajectory import Motion
from articulated.trajectory.report import beyond_limits

FAST = 30.0
"""A joint that turns faster jumps [rad/s]: five turns a second."""
LOW = 0.03
"""A link that is no higher is on the ground [m]."""


@dataclass(frozen=True)
class Jump:
    """A joint that moves too far from one frame to the next.

    Attributes:
        joint: its name.
        time: of the frame before [s].
        speed: [rad/s or m/s].
    """

    joint: str
    time: float
    speed: float


@dataclass(frozen=True, eq=False)
class Audit:
    """What `audit` measured.

    Attributes:
        torques: largest torque or force of each joint in inverse dynamics, without the ground [N m, N], by joint.
        root_force, root_couple: what holds the root in the world there, largest and root mean square [N], [N m]:
            what the ground would have to give.
        sliding: how fast links slide where they are on the ground: the mean over frames of the fastest [m/s], by link.
        penetration: how deep the deepest point is in the ground [m].
        violations: by how much joints pass their limits [rad or m], by joint; those that do.
        jumps: frames at which joints jump.
    """

    torques: dict[str, float]
    root_force: tuple[float, float]
    root_couple: tuple[float, float]
    sliding: dict[str, float]
    penetration: float
    violations: dict[str, float]
    jumps: tuple[Jump, ...]

    def __str__(self) -> str:
        def worst(values: dict[str, float], unit: str) -> str:
            some = sorted(values.items(), key=lambda item: -item[1])[:3]
            return ", ".join(f"{name} {value:.3g} {unit}" for name, value in some) or "none"

        lines = [
            f"largest torques    {worst(self.torques, 'N m')}",
            f"root, without ground  {self.root_force[0]:.3g} N, {self.root_couple[0]:.3g} N m at most,"
            f" {self.root_force[1]:.3g} N, {self.root_couple[1]:.3g} N m rms",
            f"sliding on ground  {worst(self.sliding, 'm/s')}",
            f"penetration        {self.penetration:.3g} m",
            f"beyond limits      {worst(self.violations, 'rad or m')}",
        ]
        lines += [f"jump               {jump.joint} at {jump.time:.3f} s, {jump.speed:.3g} rad/s" for jump in self.jumps[:10]]
        if len(self.jumps) > 10:
            lines.append(f"                   and {len(self.jumps) - 10} more")
        return "\n".join(lines)


def audit(motion: Motion, *, fast: float = FAST, low: float = LOW) -> Audit:
    """Look a motion over: torques, residual wrench of the root, sliding feet, penetration, limits, and jumps.

        print(art.audit(walk))

    Torques and wrenches are those of inverse dynamics from frame to frame: filter a motion before believing them. The ground is
    the plane z = 0, and gives nothing there: a root that is held by nobody shows what it would have to give.

    Args:
        motion: what is to be looked at.
        fast: a joint that moves faster jumps [rad/s, m/s].
        low: links that are no higher above the ground should not slide [m].
    """
    rig, q, v = motion.rig, motion.q, motion.v
    a = np.gradient(v, 1.0 / motion.fps, axis=0)
    tau = inverse_dynamics(rig, q, v, a)
    roots = [joint for joint in rig.joints.values() if rig.is_root(joint)]
    joints = [joint for joint in rig.joints.values() if not joint.mimic and not rig.is_root(joint)]
    torques = {joint.name: float(np.linalg.norm(tau[:, joint.v_slice], axis=-1).max()) for joint in joints}
    wrench = tau[:, roots[0].v_slice] if roots and roots[0].kind == "floating" else np.zeros((len(q), 6))
    heights = lowest(rig, q)
    return Audit(
        torques,
        _size(wrench[:, :3]),
        _size(wrench[:, 3:]),
        _sliding(motion, heights, low),
        float(max(0.0, -heights.min(initial=np.inf))),
        {joint.name: beyond for joint in joints if (beyond := beyond_limits(joint, q[:, joint.q_slice])) > 1e-9},
        _jumps(motion, fast),
    )


def _size(vectors: np.ndarray) -> tuple[float, float]:
    sizes = np.linalg.norm(vectors, axis=-1)
    return float(sizes.max()), float(np.sqrt(np.mean(sizes**2)))


def _sliding(motion: Motion, heights: np.ndarray, low: float) -> dict[str, float]:
    """Of links that are ever on the ground, over the frames in which they are."""
    speeds = np.linalg.norm(link_velocities(motion.rig, motion.q, motion.v)[..., :2], axis=-1)
    found = {}
    for link in motion.rig.links.values():
        down = heights[:, link.index] < low
        if down.any():
            found[link.name] = float(speeds[down, link.index].mean())
    return found


def _jumps(motion: Motion, fast: float) -> tuple[Jump, ...]:
    steps = difference(motion.rig, motion.q[:-1], motion.q[1:]) * motion.fps
    found = []
    for joint in motion.rig.joints.values():
        if joint.mimic:
            continue
        speed = np.linalg.norm(steps[:, joint.v_slice], axis=-1)
        found += [Jump(joint.name, float(k / motion.fps), float(speed[k])) for k in np.flatnonzero(speed > fast)]
    return tuple(sorted(found, key=lambda jump: jump.time))
