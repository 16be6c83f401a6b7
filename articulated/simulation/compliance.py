"""Ground, stops and drives as smooth forces of position and velocity, for methods that look for a smooth right side.

The laws are those of the implicit step, at the present position and velocity: Hunt and Crossley's k x (1 + d ẋ) along the
normal, friction μ f u/√(u² + ε²) across it, which creeps where the step's anchors hold; no restitution but what d leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from articulated.dynamics.loops.closure import lines
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import Tree, force_at, in_world, tree
from articulated.scalar import Scalar, maximum, minimum, sqrt
from articulated.simulation.contact.gaps import gaps
from articulated.simulation.contact.meeting import touches
from articulated.simulation.implicit.terms import SLIP_SPEED
from articulated.simulation.rooms import rooms
from articulated.simulation.scene import Drives, Numbers, Scene
from articulated.spatial import Force, Motion, Vec3


@dataclass(frozen=True, eq=False)
class Given:
    """What the scene gives: generalized forces, forces on bodies in their own axes and the power of these, and ropes' pulls."""

    tau: list[Scalar]
    on_bodies: list[Force | None]
    power: Scalar
    pulls: list[Scalar]

    def on_body(self, now: Tree, i: int, f: Force) -> None:
        """Add a force on a body, about O."""
        force, so_far = now.X[i].force_to_child(f), self.on_bodies[i]
        self.on_bodies[i] = force if so_far is None else so_far + force


def compliance(
    scene: Scene,
    numbers: Numbers,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    errors: Sequence[Scalar],
    tables: Sequence[Any],
) -> Given:
    """What it gives at q and v, for drives that are so far from their targets, and height fields of these heights."""
    m = scene.mechanism
    tau: list[Scalar] = [0.0] * m.nv
    for room in rooms(scene, q):
        stiffness, dissipation = numbers.stop_stiffness / room.w, numbers.stop_dissipation
        speed = sum((x * v[s] for s, x in room.direction.items()), 0.0)
        for sign, left in room.ends:
            push = _push(left, speed * sign, stiffness, dissipation) * sign
            for s, x in room.direction.items():
                tau[s] = tau[s] + push * x
    drives = scene.drives or Drives((), False)
    for k, s in enumerate(drives.coordinates):
        wanted = numbers.drives.stiffness[k] * errors[k] - numbers.drives.damping[k] * v[s]
        if drives.limited:
            limit = numbers.drives.limit[k]
            wanted = maximum(minimum(wanted, limit), -limit)
        tau[s] = tau[s] + wanted
    given = Given(tau, [None] * m.nbodies, 0.0, [])
    if scene.contacts or scene.ropes:
        now = tree(m, q)
        V = now.velocities(in_world(now, v))
        given = _pulled(scene, numbers, now, q, V, given)
        given = _touched(scene, numbers, now, V, given, tables) if scene.contacts else given
    return given


def _pulled(scene: Scene, numbers: Numbers, now: Tree, q: Sequence[Scalar], V: Sequence[Motion], given: Given) -> Given:
    """With ropes: stops at their full length."""
    pulls, power = [], given.power
    for rope, line in zip(scene.ropes, lines(now, q, scene.ropes), strict=True):
        speed = line.speed(V, ())
        pull = -_push(-line.gap, -speed, numbers.stop_stiffness / scene.rope_felt(rope), numbers.stop_dissipation)
        pulls.append(pull)
        power = power + pull * speed
        assert line.K is not None
        for body, sign in ((line.a, -1.0), (line.b, 1.0)):
            if body != WORLD:
                given.on_body(now, body, line.K * (pull * sign))
    return Given(given.tau, given.on_bodies, power, pulls)


def _touched(scene: Scene, numbers: Numbers, now: Tree, V: Sequence[Motion], given: Given, tables: Sequence[Any]) -> Given:
    """With what touches the ground, or each other."""
    power = given.power
    met = touches(now, scene.pieces, scene.pairs, near=True)
    for n, gap in enumerate([*gaps(scene, now, tables), *met]):
        material, ends = numbers.materials[scene.material_of(n)], (scene.body_of(n), scene.other_of(n))
        ground = Vec3.of(scene.velocity) if n < scene.touches else Vec3.zero()
        motion = V[ends[0]] - V[ends[1]] if ends[1] != WORLD else V[ends[0]]
        u = motion.linear + motion.angular.cross(gap.point) - ground
        un = gap.normal.dot(u)
        push = _push(gap.size, un, material.stiffness, material.dissipation)
        across = u - gap.normal * un
        rub = material.friction * push / sqrt(across.dot(across) + SLIP_SPEED * SLIP_SPEED)
        f = gap.normal * push - across * rub
        power = power + f.dot(u + ground)
        for body, sign in zip(ends, (1.0, -1.0), strict=True):
            if body != WORLD:
                given.on_body(now, body, force_at(gap.point, f * sign, Vec3.zero()))
    return Given(given.tau, given.on_bodies, power, given.pulls)


def _push(gap: Scalar, u: Scalar, stiffness: Scalar, dissipation: Scalar) -> Scalar:
    return stiffness * maximum(-gap, 0.0) * maximum(1.0 - dissipation * u, 0.0)
