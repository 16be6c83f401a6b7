"""Semi-implicit Euler with all that is stiff or one-sided implicit: velocity first, from one convex problem, then position.

Contact, joint limits, drives, damping and friction are in that problem together; see `newton`. What is carried besides q and v
is a `Stance`. Order 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from articulated.dynamics.loops.closure import lines
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.sweep import Sweep, Ties
from articulated.dynamics.tree import Tree, along_coordinates, in_world, tree
from articulated.scalar import Scalar, given, maximum, minimum, sqrt, where
from articulated.simulation.contact.gaps import folded, gaps
from articulated.simulation.forces import Forces, dot
from articulated.simulation.implicit.closing import bends, closed_step, moved
from articulated.simulation.implicit.iterate import Iterate
from articulated.simulation.implicit.meetings import meetings
from articulated.simulation.implicit.momentum import Past, momenta
from articulated.simulation.implicit.newton import begin, solved
from articulated.simulation.implicit.problem import (
    ANCHORING,
    contacts,
    drives,
    joint_terms,
    linear_part,
    restitutions,
)
from articulated.simulation.implicit.rebound import rebounded
from articulated.simulation.implicit.stance import Stance, Standing, rubbing
from articulated.simulation.implicit.terms import SLIP_SPEED, Contact
from articulated.simulation.implicit.towing import Tow
from articulated.simulation.implicit.values import Terms, Three
from articulated.spatial import Mat3, Vec3

_BITS = 20
"""Of a number that is exact in single precision too."""


def semi_implicit_step(start: Standing, forces: Forces, h: Scalar) -> Standing:
    """One step of length h."""
    scene, now = forces.scene, tree(forces.mechanism, start.q)
    v = in_world(now, start.carried)
    V = now.velocities(v)
    p, mass = linear_part(start, v, forces, h)
    past = Past.of(now, start)
    tow = Tow.of(scene.carriers, forces.towed, now.origin)
    F = momenta(now, past, forces, h)
    for i, impulse in tow.impulse.items():
        F[i] = F[i] + impulse
    carried = along_coordinates(now, F)
    grounded = contacts(scene, now, past, V, gaps(scene, now, forces.tables), start.stance, forces.numbers, h)
    met, nearness = meetings(scene, now, past, V, start.stance, forces.numbers, h)
    counts = [scene.points_of(pair) for pair in scene.pairs]
    terms = Terms([*grounded, *met], joint_terms(scene, now, start, forces, h), counts, nearness)
    loops = lines(now, start.q, scene.loops)
    ropes = [term.rope[1] for term in terms.joints if term.rope is not None]
    bodies = [i for c in terms.contacts for i in (c.body, c.other)] + [i for line in ropes for i in (line.a, line.b)]
    pairs = [] if scene.iterates else scene.couplings
    coordinates = [s for j in terms.joints for s in j.direction]
    p = [a + b for a, b in zip(p, carried, strict=True)]
    ties = Ties([*loops, *ropes], scene.sizes, len(ropes))
    bodies = [i for i in bodies if i != WORLD]
    sweep = Sweep(now, p, mass, bodies, coordinates, ties, pairs, tow.inertia, tow.cross)
    bend, tolerance = bends(now, start.q, v, V, loops, h), forces.numbers.tolerance
    start_at = begin(sweep, terms, now, v, bend)
    if scene.rebounds:
        given = restitutions(scene, terms, forces.numbers)
        gravity = Vec3.of(forces.gravity)
        found, along = rebounded(sweep, terms, start_at, given, gravity, scene.rig.mass, tolerance, h, bend)
    else:
        found = along = solved(sweep, terms, start_at, scene.rig.mass, tolerance, bend)
    v_new = sweep.rest(found.v, found.pulls)
    v_moving = sweep.rest(along.v, along.pulls) if scene.rebounds else v_new
    efforts = _efforts(start, terms, found, forces, v_new, h)
    work = start.work + _work(now, terms, (start_at, found), forces, efforts, (v, v_new), h)
    stance = _stance(now, start.stance, terms, found, forces, efforts, h)
    if scene.carriers:
        V_new = now.velocities(v_new)
        for i, impulse in tow.given(V_new).items():
            work = work + 0.5 * (V[i] + V_new[i]).dot(impulse)
        stance = replace(stance, towing=tow.shown(scene.carriers, V_new))
    if not (scene.loops or scene.rebounds):
        return Standing(*moved(now, start.q, v_new, v_new, h), work, stance)
    q_new, v_end = closed_step(scene, now, start.q, v_moving, v_new, h)
    (_, v_out), (_, v_along), (_, v_on) = (moved(now, start.q, v_moving, x, h) for x in (v_end, v_moving, v_new))
    shift, carry = ([a - b for a, b in zip(x, v_out, strict=True)] for x in (v_along, v_on))
    stance = replace(stance, shift=shift if scene.rebounds else [], carry=carry if scene.loops else [])
    return Standing(q_new, v_out, work, stance)


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
    impulse = [h * (tau - d * x) for tau, d, x in zip(forces.undriven, m.damping, v_new, strict=True)]
    if forces.scene.drives and not forces.scene.drives.limited:
        for s, effort in zip(forces.scene.drives.coordinates, efforts, strict=True):
            impulse[s] = impulse[s] + h * effort
    for joint, y in zip(terms.joints, found.y.joints, strict=True):
        for s, x in joint.direction.items():
            impulse[s] = impulse[s] - y * x
    work = dot(impulse, mean)
    for n, joint in enumerate(terms.joints):
        if joint.rope is not None:
            work = work - found.y.joints[n] * (0.5 * (begun.u.joints[n] + found.u.joints[n]))

    def of_contact(contact: Contact, before: Three, after: Three, y: Three) -> list[Scalar]:
        return [Vec3.of(y).dot((Vec3.of(before) + Vec3.of(after)) * 0.5 + contact.ground)]

    taken = terms.each(of_contact, 1, begun.u.contacts, found.u.contacts, found.y.contacts)
    work = work - terms.total(taken, [[0.0]] * len(terms.joints), 1)[0]
    V_mean = now.velocities(mean) if forces.external else []
    for (i, X_BL), wrench in zip(m.links, forces.external or (), strict=bool(forces.external)):
        if i != WORLD:
            at = V_mean[i].linear + V_mean[i].angular.cross(now.X[i].transform_point(X_BL.p))
            work = work + h * dot(wrench, [*at, *V_mean[i].angular])
    return work


def _stance(
    now: Tree, before: Stance, terms: Terms, found: Iterate, forces: Forces, efforts: Sequence[Scalar], h: Scalar
) -> Stance:
    """What is carried on."""
    scene, first = forces.scene, forces.scene.touches

    def on_ground(n: int) -> list[Scalar]:
        u, y, limit = Vec3.of(found.u.contacts[n]), Vec3.of(found.y.contacts[n]), found.limits[n]
        stretch = _stretch(terms.contacts[n], u, y, limit, h)
        return [*folded(scene.surface_of(n), terms.contacts[n].n, stretch), *(-(x / h) for x in y)]

    def on_body(contact: Contact, u: Three, y: Three, limit: Scalar, R: list[Scalar]) -> list[Scalar]:
        stretch = _stretch(contact, Vec3.of(u), Vec3.of(y), limit, h)
        return list(Mat3.of([R[k : k + 3] for k in (0, 3, 6)]).transpose_times(stretch))

    contacts = terms.contacts
    ground = [given(contact.near, partial(on_ground, n), [0.0] * 5) for n, contact in enumerate(contacts[:first])]
    axes = [Mat3.identity() @ now.X[c.other].R if c.other != WORLD else Mat3.identity() for c in contacts[first:]]
    turned = [[x for row in R.rows for x in row] for R in axes]
    some = found.u.contacts[first:], found.y.contacts[first:], found.limits[first:], turned
    grips = terms.of_met(on_body, 3, *some, otherwise=0.0)
    pair_forces = terms.of_pairs(lambda _, y: [-(x / h) for x in y], 3, found.y.contacts[first:], otherwise=0.0)
    dry = [(joint, u) for joint, u in zip(terms.joints, found.u.joints, strict=True) if joint.dry is not None]
    speed = {s: u for joint, u in dry for s in joint.direction}
    longest = SLIP_SPEED * h / ANCHORING
    rubbed = zip(rubbing(scene.mechanism), before.slack, strict=True)
    slack = [minimum(maximum(x + h * speed[s], -longest), longest) for s, x in rubbed]
    residual = sqrt(found.error)
    return Stance(
        [x[:2] for x in ground],
        grips,
        slack,
        h,
        before.shift,
        before.carry,
        [x[2:] for x in ground],
        pair_forces,
        list(efforts),
        [x / h for x in found.pulls],
        maximum(before.residual, residual),
        before.failures + where(residual < forces.numbers.tolerance, 0.0, 1.0),
        _pattern([where(contact.near, 1.0, 0.0) for contact in contacts[:first]]),
        _pattern(terms.nearness),
        found.k,
        before.sweeps + found.k,
        before.towing,
    )


def _pattern(held: Sequence[Scalar]) -> Scalar:
    """Of some scalars, 0 or 1, a number that differs where they do, if they are not many."""
    return sum((x * 2.0 ** (n % _BITS) for n, x in enumerate(held)), 0.0)


def _stretch(contact: Contact, u: Vec3, y: Vec3, limit: Scalar, h: Scalar) -> Vec3:
    """How far a contact's anchor is stretched: as far as friction can hold it, and not at all where nothing pushes."""
    dragged = contact.pull(u) - contact.anchor * (1.0 - 1.0 / ANCHORING)
    longest = contact.width(limit) * (1.0 / ANCHORING)
    square = dragged.dot(dragged)
    slid = square > longest * longest
    kept = where(slid, longest / sqrt(where(slid, square, 1.0)), 1.0)
    return dragged * where(contact.n.dot(y) < 0.0, kept * h, 0.0)
