"""How a step keeps loops closed, over and above its linear system.

A step's end is where its velocities lead, so what loops hold must not move along them as they are at its beginning, but along
the chord of the arc that they will describe: K v = −½ h γ, with γ the φ̈ that there is if nothing accelerates. What that leaves
open is closed by moving positions, each coordinate as much as it is easy to move; and velocities are shown as they must be
where the step ends. The momenta that go on are the chord's: with them energy neither grows nor falls with time (SHAKE:
Ryckaert, Ciccotti, Berendsen 1977; Hairer, Lubich, Wanner, Geometric Numerical Integration, VII.1.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

from articulated.dynamics.configuration import integrate
from articulated.dynamics.joints import Ball
from articulated.dynamics.loops.closure import Line, jacobian, lines, sizes
from articulated.dynamics.loops.factor import Factor
from articulated.dynamics.tree import Tree, in_roots, tree
from articulated.scalar import Scalar
from articulated.simulation.implicit.laws import dot
from articulated.simulation.scene import Scene
from articulated.spatial import Mat3, Motion, Vec3
from articulated.spatial.rotation import rotation_of_quaternion

_BALL = Ball()


def bends(
    now: Tree, q: Sequence[Scalar], v: Sequence[Scalar], V: Sequence[Motion], rows: Sequence[Line], h: Scalar
) -> list[Scalar]:
    """−½ h γ of each row."""
    A = now.accelerations(q, v, V, straight=True) if rows else []
    return [(-0.5 * h) * line.curvature(V, A) for line in rows]


def closed_step(
    scene: Scene, now: Tree, q: Sequence[Scalar], v: Sequence[Scalar], v_end: Sequence[Scalar], h: Scalar
) -> tuple[list[Scalar], list[Scalar]]:
    """Where a step with velocities v leads, with loops closed; and v_end such that it keeps them so there.

    One step of Newton's method from where v leads by itself: loops are closed but for the square of what is left to close.
    """
    q_new, _ = moved(now, q, v, v, h)
    if not scene.loops:
        return q_new, list(v_end)
    there = tree(now.mechanism, q_new)
    rows = lines(there, q_new, scene.loops)
    J = jacobian(there, rows)
    ease = scene.ease
    matrix: dict[tuple[int, int], Scalar] = {}
    for j, k in combinations_with_replacement(range(len(J)), 2):
        if common := [s for s in J[j] if s in J[k]]:
            matrix[j, k] = dot([J[j][s] * ease[s] for s in common], [J[k][s] for s in common])
    factor = Factor(matrix, sizes(scene.loops))

    def changed(v: Sequence[Scalar], change: Sequence[Scalar]) -> list[Scalar]:
        result, pulls = list(v), factor.solve(change, corrections=0)
        for row, pull in zip(J, pulls, strict=True):
            for s, x in row.items():
                result[s] = result[s] + x * (ease[s] * pull)
        return result

    speeds = [dot(list(row.values()), [v_end[s] for s in row]) for row in J]
    v_new = changed(v, [-(line.gap / h) for line in rows])
    return moved(now, q, v_new, v_new, h)[0], changed(v_end, [-x for x in speeds])


def moved(
    now: Tree, q: Sequence[Scalar], v: Sequence[Scalar], v_end: Sequence[Scalar], h: Scalar
) -> tuple[list[Scalar], list[Scalar]]:
    """q after a step with the velocities v, and those at its end as the outside has them there.

    Free roots move straight, and their velocities are in their own axes: those at the end of the step.
    """
    m = now.mechanism
    q_new, turned = integrate(m, q, [h * x for x in v]), {}
    for i in m.free_roots:
        joint, R_WP = m.joints[i], m.placement[i].R
        at, linear, angular = joint.q[0], Vec3.of([v[s] for s in joint.v[:3]]), Vec3.of([v[s] for s in joint.v[3:]])
        step = R_WP.transpose_times(linear * h)
        turn = now.X[i].R.transpose_times(angular * h)
        quat_xyzw = _BALL.integrate(q[at + 3 : at + 7], list(turn))
        q_new[at : at + 7] = [*(x + dx for x, dx in zip(q[at : at + 3], step, strict=True)), *quat_xyzw]
        turned[i] = (Mat3.identity() @ R_WP) @ rotation_of_quaternion(quat_xyzw)
    return q_new, in_roots(m, turned, v_end)
