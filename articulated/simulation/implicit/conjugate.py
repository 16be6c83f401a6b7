"""The linear system of a step with many contacts between bodies, by conjugate gradients: a few turns of O(n) each.

symbol   meaning
T        the system without what contacts between bodies add: one sweep solves it
H        T + Jᵀ G J, with J and G of the contacts between bodies
r        what is left of the right side, b − H v
z        T⁻¹ r

With T as the preconditioner no mass matrix is needed: with p ← z + β p goes T p ← r + β T p, and H p = T p + Jᵀ G J p. The
sweep is folded once; each turn carries one right side through it. Where no contact acts, T is H: one turn solves it.
Hestenes and Stiefel 1952; Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.sweep import Sweep
from articulated.dynamics.tree import along_coordinates
from articulated.scalar import Scalar, given, maximum, repeat, sqrt, where
from articulated.simulation.implicit.iterate import Iterate
from articulated.simulation.implicit.laws import dot
from articulated.simulation.implicit.linear import Linear
from articulated.simulation.implicit.terms import Contact, Reaction
from articulated.simulation.implicit.values import Terms, Values
from articulated.spatial import Force, Motion, Vec3

TURNS = 20
ETA = 0.1
"""It is solved until √(rᵀ z) is this part of what it was."""
_TINY = 1e-30


def begin(sweep: Sweep, terms: Terms, at: Iterate, target: Sequence[Scalar]) -> Iterate:
    """Where to begin: what solves the system as if no bodies touched each other. `target` is as of `Sweep.solve`."""
    linear = Linear.of(terms, at.u, at.limits, 0.0)
    v, V, pulls = sweep.solve(linear.add(sweep.unloaded(), pairs=False), target, 0)
    y = linear.answer(terms.velocities(V, v))
    y.contacts[terms.grounded :] = [
        [0.0] * 3 if contact.other != WORLD else x
        for contact, x in zip(terms.contacts[terms.grounded :], y.contacts[terms.grounded :], strict=True)
    ]
    return replace(at, v=[v[s] for s in sweep.moving], pulls=pulls, y=y, left=[0.0] * len(sweep.moving))


def solve(sweep: Sweep, linear: Linear, at: Iterate) -> tuple[list[Scalar], list[Motion], list[Scalar], list[Scalar], Scalar]:
    """Velocities of coordinates and bodies, loops' pulls, r, and √(rᵀ z).

    It starts from the velocities of an iterate: so what it finds is downhill from there, however soon it ends.
    """
    terms = linear.terms
    folded = sweep.folded(linear.add(sweep.unloaded(), pairs=False))
    first = terms.grounded

    def resisted(p: Sequence[Scalar]) -> list[Scalar]:
        """Jᵀ G J p."""
        motions = terms.motions(sweep.tree.velocities(spread(sweep, p)))

        def push(contact: Contact, numbers: Sequence[Scalar], own: Motion, other: Motion) -> list[Scalar]:
            u = contact.velocity(own, other)
            return _force(contact, Reaction.of(numbers, contact.n).times(u))

        pushes = terms.of_pairs(push, 6, linear.reactions[first:], *(x[first:] for x in motions), otherwise=0.0)
        coupled = [other != WORLD for _, other in terms.ends]  # the rest is in T
        return _along(sweep, terms, [push if both else None for push, both in zip(pushes, coupled, strict=True)])

    def turn(at: list) -> list:
        v, pulls, r, p, p_pulls, Tp, square = at
        Hp = [a + b for a, b in zip(Tp, resisted(p), strict=True)]
        alpha = square / maximum(dot(p, Hp), _TINY * _TINY)
        v, pulls, r = _plus(v, alpha, p), _plus(pulls, alpha, p_pulls), _plus(r, -alpha, Hp)
        z, z_pulls = again(r)
        new = dot(z, r)
        beta = new / square
        return [v, pulls, r, _plus(z, beta, p), _plus(z_pulls, beta, p_pulls), _plus(r, beta, Tp), new]

    def again(r: Sequence[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
        z, _, pulls = sweep.again(folded, r)
        return [z[s] for s in sweep.moving], pulls

    v = spread(sweep, at.v)
    y = linear.answer(terms.velocities(sweep.tree.velocities(v), v))
    excess = at.y.minus(y)
    pushes = terms.of_pairs(lambda contact, y: _force(contact, Vec3.of(y)), 6, excess.contacts[first:], otherwise=0.0)
    r = _plus(_along(sweep, terms, pushes, excess), 1.0, at.left)
    z, z_pulls = again(r)
    square = dot(z, r)
    enough = maximum((ETA * ETA) * square, _TINY)
    start = [list(at.v), list(at.pulls), r, z, z_pulls, r, square]
    v, pulls, r, *_, square = repeat(TURNS, turn, start, lambda at: where(at[-1] > enough, 1.0, 0.0) < 0.5)
    v = spread(sweep, v)
    return v, sweep.tree.velocities(v), pulls, r, sqrt(maximum(square, 0.0))


def _along(sweep: Sweep, terms: Terms, pushes: Sequence[Sequence[Scalar] | None], others: Values | None = None) -> list[Scalar]:
    """Jᵀ y along the coordinates that move, for forces of pairs on their first bodies, and impulses of all other terms."""
    F, alone = [Force.zero()] * sweep.mechanism.nbodies, [0.0] * sweep.mechanism.nv
    for push, (body, other) in zip(pushes, terms.ends, strict=True):
        if push is not None:
            _push(F, Force.of(push), body, other)
    if others is not None:
        for contact, y in zip(terms.contacts[: terms.grounded], others.contacts, strict=False):
            body, force = contact.body, _force(contact, Vec3.of(y))
            F[body] = given(contact.near, lambda b=body, f=force: F[b] + Force.of(f), F[body])
        for joint, y in zip(terms.joints, others.joints, strict=True):
            direction = joint.direction if joint.rope is None else joint.rope[1].turns
            if joint.rope is not None and joint.rope[1].K is not None:
                _push(F, joint.rope[1].K * y, joint.rope[1].b, joint.rope[1].a)
            for s, x in direction.items():
                alone[s] = alone[s] + y * x
    along = along_coordinates(sweep.tree, F)
    return [along[s] + alone[s] for s in sweep.moving]


def spread(sweep: Sweep, moving: Sequence[Scalar]) -> list[Scalar]:
    """Velocities of all coordinates, those that do not move with the load 0."""
    v: list[Scalar] = [0.0] * sweep.mechanism.nv
    for s, x in zip(sweep.moving, moving, strict=True):
        v[s] = x
    return v


def _push(F: list[Force], force: Force, body: int, other: int) -> None:
    """Add a force on one body, and its reaction on another."""
    for i, sign in ((body, 1.0), (other, -1.0)):
        if i != WORLD:
            F[i] = F[i] + force * sign


def _force(contact: Contact, y: Vec3) -> list[Scalar]:
    """Of an impulse at a contact, about O."""
    return [*contact.r.cross(y), *y]


def _plus(a: Sequence[Scalar], s: Scalar, b: Sequence[Scalar]) -> list[Scalar]:
    return [x + s * y for x, y in zip(a, b, strict=True)]
