"""What happens to a particle on its way: it runs into something within a step, bounces off, slides or comes to rest.

At the moment of impact V′ = V_T − k_r V_N, less what Coulomb's friction takes of V_T; the rest of the step begins there. What
would come back before the step ends stays, pressed on by what accelerates it: F′ = F_T, less friction (Witkin and Baraff,
Physically Based Modeling, 1997, C). So bounces end, and what rests does not sink.

The velocities of some methods belong to a moment beside that of their positions: those of the semi-implicit one to half a step
before, as in the leapfrog method. An impact at the speed that they tell would lose height at each bounce.

symbol   meaning
s        part of the step that is over
a        acceleration over the step, taken as constant
"""

from __future__ import annotations

from collections.abc import Sequence

from articulated.particles.colliders import LIFT, NEAR, Collider
from articulated.scalar import Scalar, either, given, maximum, sqrt, where
from articulated.spatial import Vec3

_TINY = 1e-30


def collided(
    colliders: Sequence[Collider],
    t: Scalar,
    h: Scalar,
    x: Vec3,
    v: Vec3,
    new_x: Vec3,
    new_v: Vec3,
    free: Scalar = True,
    lag: float = 0.0,
) -> tuple[Vec3, Vec3]:
    """Where a particle is after a step, and how fast, that would have gone from x and v to the new ones.

    Args:
        colliders: what it may run into.
        t, h: when the step begins, and its length.
        x, v, new_x, new_v: see above.
        free: whether it feels them at all; what is pinned goes through, or stays inside.
        lag: by how much of a step velocities belong to an earlier moment.
    """
    for collider in colliders:
        s, hits = collider.crossing(t, h, x, new_x)
        gap, _ = collider.gap(t + h, new_x)

        def after(
            collider: Collider = collider, s: Scalar = s, hits: Scalar = hits, new: tuple[Vec3, Vec3] = (new_x, new_v)
        ) -> tuple[Vec3, Vec3]:
            there, then_v = either(hits, _met(collider, t, h, (x, v), new, s, lag), new)
            gap, n = collider.gap(t + h, there)
            return there + n * where(gap < 0.0, LIFT - gap, 0.0), then_v

        new_x, new_v = given((where(hits, -1.0, gap) < 0.0) & free, after, (new_x, new_v))
    return new_x, new_v


def _met(
    collider: Collider, t: Scalar, h: Scalar, old: tuple[Vec3, Vec3], new: tuple[Vec3, Vec3], s: Scalar, lag: float
) -> tuple[Vec3, Vec3]:
    """As `collided`, of what meets a collider."""
    (x, v), (new_x, new_v) = old, new
    a = (new_v - v) * (1.0 / h)
    at, speed = x + (new_x - x) * s, v + (new_v - v) * s
    rest, then = (1.0 - s) * h, t + s * h
    _, n = collider.gap(then, at)
    surface = collider.velocity(then, at)
    relative = speed - surface
    late = where(n.dot(x - at) > NEAR, n.dot(a) * (lag * h), 0.0)  # but not those of what rests already
    normal = n.dot(relative) + late
    incoming = maximum(-normal, 0.0)
    along = _slowed(relative - n * n.dot(relative), collider.friction * (1.0 + collider.restitution) * incoming)
    leaving, pressing = collider.restitution * incoming, -n.dot(a)
    stays = (2.0 * leaving <= pressing * rest) & (pressing >= 0.0)
    # it stays on the surface
    drift = along + (a - n * n.dot(a)) * rest
    resting = _slowed(drift, collider.friction * pressing * rest)
    rested = at + (along + resting) * (0.5 * rest) + surface * rest
    # it leaves
    flying = along + n * leaving
    flown = at + (flying + surface) * rest + a * (0.5 * rest * rest)
    there, then_v = either(stays, (rested, resting + surface), (flown, flying + surface + a * rest - n * late))
    return collider.onward(then, rest, at, there), then_v


def _slowed(v: Vec3, by: Scalar) -> Vec3:
    """A velocity after friction took so much of its speed, all of it if there is less."""
    return v * maximum(1.0 - by / sqrt(maximum(v.dot(v), _TINY)), 0.0)
