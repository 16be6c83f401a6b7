"""What a step has to solve: the terms that act, and the linear part, A v = p.

The linear part has in A, besides the mass matrix, what damping and unlimited drives add to it: armature + h d + h² p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from articulated.dynamics.loops.closure import lines, sizes
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, maximum, minimum
from articulated.simulation.contact.gaps import Gap, spread
from articulated.simulation.forces import Forces
from articulated.simulation.implicit.laws import Cone, Drive, Hinge, dot
from articulated.simulation.implicit.momentum import Past
from articulated.simulation.implicit.stance import Stance, Standing, rubbing
from articulated.simulation.implicit.terms import NEAR_RIGID, SLIP_SPEED, Contact, JointTerm
from articulated.simulation.implicit.values import Terms
from articulated.simulation.rooms import rooms
from articulated.simulation.scene import Numbers, Scene
from articulated.spatial import Motion, Vec3

ANCHORING = 0.2
"""The part of an anchor's stretch that a step would undo."""
REACH = 10.0
"""A point that would have to come so much faster than it does, to touch in this step, is left out of it [m/s]."""
REACH_OF_STOPS = 50.0
"""Likewise a stop, for a joint [rad/s, m/s]."""
FASTEST_SAG = 1.0
"""What strays faster towards the ground is not made up for: after an impact it may not stray any more [m/s]."""


def contacts(
    scene: Scene, now: Tree, past: Past, V: Sequence[Motion], gaps: Sequence[Gap], stance: Stance, numbers: Numbers, h: Scalar
) -> list[Contact]:
    """With the ground, of all gaps, open ones too: a step may close them. V are the velocities that bodies have."""
    result = []
    for n, (gap, anchor) in enumerate(zip(gaps, stance.anchors, strict=True)):
        material, w = numbers.materials[scene.material_of(n)], scene.felt(n)
        contact = Contact(
            body=scene.body_of(n),
            r=gap.point,
            n=gap.normal,
            hinge=hinge(gap.size, material.stiffness, material.dissipation, w, h, arc_sag(scene, now, past, gap, n)),
            anchor=spread(scene.surface_of(n), gap.normal, anchor) * (ANCHORING / h),
            ground=Vec3.of(scene.velocity),
            friction=material.friction,
            w=w,
            near=True,
        )
        result.append(
            replace(
                contact, near=gap.size + h * (gap.normal.dot(contact.velocity(V[contact.body], Motion.zero())) - REACH) < 0.0
            )
        )
    return result


def arc_sag(scene: Scene, now: Tree, past: Past, gap: Gap, n: int) -> Scalar:
    """What a contact's way will stray from a straight one along the normal, if it does so as in the step before."""
    candidate = scene.candidates[scene.candidate_of(n)]
    body, X_BL = scene.mechanism.links[candidate.link]
    strayed = past.strayed(now, body, X_BL.transform_point(Vec3.of(candidate.center)))
    return maximum(gap.normal.dot(strayed), -(FASTEST_SAG * past.h))


def hinge(gap: Scalar, stiffness: Scalar, dissipation: Scalar, w: float, h: Scalar, sag: Scalar = 0.0) -> Hinge:
    """The law of a stop that is so far away, no harder than a step can follow where an impulse gives so much velocity.

    `sag` is what the step will add to the gap besides h u.
    """
    mass = minimum(h * h * stiffness, NEAR_RIGID / w)
    return Hinge(-((gap + sag) * mass) / h, mass, dissipation, 1.0 - dissipation * (sag / h))


def joint_terms(scene: Scene, now: Tree, start: Standing, forces: Forces, h: Scalar) -> list[JointTerm]:
    """Stops, limited drives and dry friction, one term for each coordinate that has any of them; then stops of balls; ropes."""
    m, numbers = scene.mechanism, forces.numbers
    stops: dict[int, tuple[tuple[float, Hinge], ...]] = {}
    near: dict[int, Scalar] = {}
    cones: list[JointTerm] = []
    for room in rooms(scene, start.q):
        stiffness, dissipation = numbers.stop_stiffness / room.w, numbers.stop_dissipation
        ends = tuple((sign, hinge(left, stiffness, dissipation, room.w, h)) for sign, left in room.ends)
        speed = dot(list(room.direction.values()), [start.v[s] for s in room.direction])
        closest = [left + h * (sign * speed - REACH_OF_STOPS) for sign, left in room.ends]
        is_near = (closest[0] if len(closest) == 1 else minimum(*closest)) < 0.0
        if len(room.direction) == 1:
            stops.update((s, ends) for s in room.direction)
            near.update((s, is_near) for s in room.direction)
        else:
            cones.append(JointTerm(room.direction, ends, None, None, room.w, is_near))
    motors: dict[int, Drive] = {}
    if scene.drives and scene.drives.limited:
        for k, (s, (c, b)) in enumerate(zip(scene.drives.coordinates, drives(start, forces, h), strict=True)):
            motors[s] = Drive(c, b, numbers.drives.limit[k] * h)
    dry: dict[int, tuple[Cone, Scalar]] = {}
    for s, slack in zip(rubbing(m), start.stance.slack, strict=True):
        dry[s] = Cone(h * m.friction[s], SLIP_SPEED), slack * (ANCHORING / h)
    acted = sorted({*stops, *motors, *dry})
    alone = []
    for s in acted:
        always = s in motors or s in dry
        alone.append(JointTerm({s: 1.0}, stops.get(s, ()), motors.get(s), dry.get(s), scene.joint_felt([s]), always or near[s]))
    return [*alone, *cones, *_ropes(now, start, forces, h)]


def _ropes(now: Tree, start: Standing, forces: Forces, h: Scalar) -> list[JointTerm]:
    """Ropes, which stop at their full length."""
    scene, numbers = forces.scene, forces.numbers
    result, first = [], sum(sizes(scene.loops))
    for k, (rope, line) in enumerate(zip(scene.ropes, lines(now, start.q, scene.ropes), strict=True)):
        w = scene.rope_felt(rope)
        stop = hinge(-line.gap, numbers.stop_stiffness / w, numbers.stop_dissipation, w, h)
        result.append(JointTerm({}, ((-1.0, stop),), None, None, w, True, (first + k, line)))
    return result


def drives(start: Standing, forces: Forces, h: Scalar) -> list[tuple[Scalar, Scalar]]:
    """c and b of each drive, which gives the impulse c − b v."""
    gains = forces.numbers.drives
    return [
        (h * p * error, h * (d + h * p))
        for p, d, error in zip(gains.stiffness, gains.damping, forces.errors(start.q), strict=True)
    ]


def linear_part(start: Standing, v: Sequence[Scalar], forces: Forces, h: Scalar) -> tuple[list[Scalar], list[Scalar]]:
    """What joints add to p and to the diagonal of A; without stops, limited drives and dry friction."""
    m, scene = forces.mechanism, forces.scene
    p = [a * x + h * t for a, x, t in zip(m.armature, v, forces.tau, strict=True)]
    mass = [a + h * d for a, d in zip(m.armature, m.damping, strict=True)]
    if scene.drives and not scene.drives.limited:
        for s, (c, b) in zip(scene.drives.coordinates, drives(start, forces, h), strict=True):
            p[s], mass[s] = p[s] + c, mass[s] + b
    return p, mass


def restitutions(scene: Scene, terms: Terms, numbers: Numbers) -> list[Scalar]:
    """Of all contacts, then of all stops."""
    materials = [numbers.materials[scene.material_of(n)] for n in range(scene.contacts)]
    stops = [numbers.stop_restitution for joint in terms.joints for _ in joint.stops]
    return [*(material.restitution for material in materials), *stops]
