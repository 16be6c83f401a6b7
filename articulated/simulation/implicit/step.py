"""Semi-implicit Euler with all that is stiff or one-sided implicit: velocity first, from one convex problem, then position.

Contact, joint limits, drives, damping and friction are in that problem together; see `newton`. What is carried besides q and v
is a `Stance`. Order 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from articulated.dynamics.configuration import integrate
from articulated.dynamics.joints import Ball
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import ROOT, Tree, in_root, in_world, is_free, tree
from articulated.scalar import Scalar, given, maximum, minimum, sqrt, where
from articulated.simulation.contact.gaps import folded, gaps
from articulated.simulation.forces import Forces, dot
from articulated.simulation.implicit.momentum import Past, along_coordinates, momenta
from articulated.simulation.implicit.newton import Iterate, begin, solved
from articulated.simulation.implicit.problem import ANCHORING, contacts, drives, joint_terms, linear_part, restitutions
from articulated.simulation.implicit.rebound import rebounded
from articulated.simulation.implicit.stance import Stance, Standing, rubbing
from articulated.simulation.implicit.sweep import Sweep
from articulated.simulation.implicit.terms import SLIP_SPEED, Contact
from articulated.simulation.implicit.values import Terms
from articulated.spatial import Mat3, Vec3
from articulated.spatial.rotation import rotation_of_quaternion

_BALL = Ball()


def semi_implicit_step(start: Standing, forces: Forces, h: Scalar) -> Standing:
    """One step of length h."""
    scene, now = forces.scene, tree(forces.mechanism, start.q)
    v = in_world(now, start.v)
    p, mass = linear_part(start, v, forces, h)
    past = Past.of(now, start)
    carried = along_coordinates(now, momenta(now, past, forces, h))
    terms = Terms(
        contacts(scene, now, past, now.velocities(v), gaps(scene, now, forces.tables), start.stance, forces.numbers, h),
        joint_terms(scene, start, forces, h),
    )
    bodies, coordinates = [c.body for c in terms.contacts], [s for j in terms.joints for s in j.direction]
    sweep = Sweep(now, [a + b for a, b in zip(p, carried, strict=True)], mass, bodies, coordinates)
    start_at, tolerance = begin(sweep, terms, now, v), forces.numbers.tolerance
    if scene.rebounds:
        given = restitutions(scene, terms, forces.numbers)
        gravity = Vec3.of(forces.gravity)
        found, along = rebounded(sweep, terms, start_at, given, gravity, scene.rig.mass, tolerance, h)
    else:
        found = solved(sweep, terms, start_at, scene.rig.mass, tolerance)
        along = found.v
    v_new = sweep.rest(found.v)
    v_moving = sweep.rest(along) if scene.rebounds else v_new
    efforts = _efforts(start, terms, found, forces, v_new, h)
    work = start.work + _work(now, terms, (start_at, found), forces, efforts, (v, v_new), h)
    q_new, v_end = _moved(now, start.q, v_moving, v_new, h)
    stance = _stance(start.stance, terms, found, forces, efforts, h)
    if scene.rebounds:
        _, v_along = _moved(now, start.q, v_moving, v_moving, h)
        stance = replace(stance, shift=[a - b for a, b in zip(v_along, v_end, strict=True)])
    return Standing(q_new, v_end, work, stance)


def _moved(
    now: Tree, q: Sequence[Scalar], v: Sequence[Scalar], v_end: Sequence[Scalar], h: Scalar
) -> tuple[list[Scalar], list[Scalar]]:
    """q after a step with the velocities v, and those at its end as the outside has them there.

    A free root moves straight, and its velocity is in its own axes: those at the end of the step.
    """
    m = now.mechanism
    q_new = integrate(m, q, [h * x for x in v])
    if not is_free(m):
        return q_new, list(v_end)
    joint, R_WP = m.joints[ROOT], m.placement[ROOT].R
    at, linear, angular = joint.q[0], Vec3.of([v[s] for s in joint.v[:3]]), Vec3.of([v[s] for s in joint.v[3:]])
    step = R_WP.transpose_times(linear * h)
    turn = now.X[ROOT].R.transpose_times(angular * h)
    quat_xyzw = _BALL.integrate(q[at + 3 : at + 7], list(turn))
    q_new[at : at + 7] = [*(x + dx for x, dx in zip(q[at : at + 3], step, strict=True)), *quat_xyzw]
    R_WB = (Mat3.identity() @ R_WP) @ rotation_of_quaternion(quat_xyzw)
    return q_new, in_root(m, R_WB, v_end)


def _efforts(start: Standing, terms: Terms, found: Iterate, forces: Forces, v: Sequence[Scalar], h: Scalar) -> list[Scalar]:
    """What drives gave."""
    if not forces.scene.drives:
        return []
    efforts = [(c - b * v[s]) / h for s, (c, b) in zip(forces.scene.drives.coordinates, drives(start, forces, h), strict=True)]
    if not forces.scene.drives.limited:
        return efforts
    return [minimum(maximum(x, -limit), limit) for x, limit in zip(efforts, forces.numbers.drives.limit, strict=True)]


def _work(
    now: Tree,
    terms: Terms,
    solved: tuple[Iterate, Iterate],
    forces: Forces,
    efforts: Sequence[Scalar],
    velocities: tuple[Sequence[Scalar], Sequence[Scalar]],
    h: Scalar,
) -> Scalar:
    """Of all forces but weight: impulse times mean velocity, the change of kinetic energy for a constant mass matrix."""
    m, (v, v_new), (begun, found) = now.mechanism, velocities, solved
    mean = [0.5 * (a + b) for a, b in zip(v, v_new, strict=True)]
    impulse = [h * (tau - d * x) for tau, d, x in zip(forces.tau, m.damping, v_new, strict=True)]
    if forces.scene.drives and not forces.scene.drives.limited:
        for s, effort in zip(forces.scene.drives.coordinates, efforts, strict=True):
            impulse[s] = impulse[s] + h * effort
    for joint, y in zip(terms.joints, found.y.joints, strict=True):
        for s, x in joint.direction.items():
            impulse[s] = impulse[s] - y * x
    work = dot(impulse, mean)

    def with_contact(n: int, work: Scalar) -> Scalar:
        mean = (Vec3.of(begun.u.contacts[n]) + Vec3.of(found.u.contacts[n])) * 0.5
        return work - Vec3.of(found.y.contacts[n]).dot(mean + terms.contacts[n].ground)

    for n, contact in enumerate(terms.contacts):
        work = given(contact.near, partial(with_contact, n, work), work)
    V_mean = now.velocities(mean) if forces.external else []
    for (i, X_BL), wrench in zip(m.links, forces.external or (), strict=bool(forces.external)):
        if i != WORLD:
            at = V_mean[i].linear + V_mean[i].angular.cross(now.X[i].transform_point(X_BL.p))
            work = work + h * dot(wrench, [*at, *V_mean[i].angular])
    return work


def _stance(before: Stance, terms: Terms, found: Iterate, forces: Forces, efforts: Sequence[Scalar], h: Scalar) -> Stance:
    """What is carried on."""
    scene = forces.scene

    def contact(n: int) -> list[Scalar]:
        u, y, limit = Vec3.of(found.u.contacts[n]), Vec3.of(found.y.contacts[n]), found.limits[n]
        stretch = _stretch(terms.contacts[n], u, y, limit, h)
        return [*folded(scene.surface_of(n), terms.contacts[n].n, stretch), *(-(x / h) for x in y)]

    contacts = terms.near(contact, 5)
    dry = [(joint, u) for joint, u in zip(terms.joints, found.u.joints, strict=True) if joint.dry is not None]
    speed = {s: u for joint, u in dry for s in joint.direction}
    longest = SLIP_SPEED * h / ANCHORING
    rubbed = zip(rubbing(scene.mechanism), before.slack, strict=True)
    slack = [minimum(maximum(x + h * speed[s], -longest), longest) for s, x in rubbed]
    residual = sqrt(found.error)
    return Stance(
        [x[:2] for x in contacts],
        slack,
        h,
        before.shift,
        [x[2:] for x in contacts],
        list(efforts),
        maximum(before.residual, residual),
        before.failures + where(residual < forces.numbers.tolerance, 0.0, 1.0),
        sum((where(contact.near, 2.0 ** (n % 20), 0.0) for n, contact in enumerate(terms.contacts)), 0.0),
        found.k,
        before.sweeps + found.k,
    )


def _stretch(contact: Contact, u: Vec3, y: Vec3, limit: Scalar, h: Scalar) -> Vec3:
    """How far a contact's anchor is stretched: as far as friction can hold it, and not at all where nothing pushes."""
    dragged = contact.pull(u) - contact.anchor * (1.0 - 1.0 / ANCHORING)
    longest = contact.width(limit) * (1.0 / ANCHORING)
    square = dragged.dot(dragged)
    slid = square > longest * longest
    kept = where(slid, longest / sqrt(where(slid, square, 1.0)), 1.0)
    return dragged * where(contact.n.dot(y) < 0.0, kept * h, 0.0)
