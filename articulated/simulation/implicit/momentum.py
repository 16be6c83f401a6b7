"""What each coordinate's momentum would be at the end of a step, but for what is implicit: the right side p of A v = p.

No velocity products: a body carries its momentum over from the configuration that it had a step ago, q ⊖ h v, and that momentum
is seen along today's S. Its centre of mass moves straight and its spin stays, whatever the joints do, so nothing blows up that
turns fast and weighs little. To first order this is M v − h C(q, v) v.
"""

from __future__ import annotations

from dataclasses import dataclass

from articulated.dynamics.configuration import integrate
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import Tree, about_center, force_at, in_world, tree
from articulated.scalar import Scalar
from articulated.simulation.forces import Forces
from articulated.simulation.implicit.stance import Standing
from articulated.spatial import Force, Mat3, Motion, Vec3


@dataclass(frozen=True, eq=False)
class Past:
    """The step before.

    Attributes:
        tree: where it began.
        V: velocities of the bodies there, as it found them.
        W: those with which it moved them.
        h: its length, 0 if there was none.
    """

    tree: Tree
    V: list[Motion]
    W: list[Motion]
    h: Scalar

    @staticmethod
    def of(now: Tree, start: Standing) -> Past:
        """The step that led to where a motion is."""
        mechanism, v, w, h = now.mechanism, start.carried, start.moved, start.stance.before
        before = tree(mechanism, integrate(mechanism, start.q, [-(h * x) for x in w]))
        # a free root's velocity is the same in world axes a step ago
        V = before.velocities(in_world(now, v))
        return Past(before, V, before.velocities(in_world(now, w)) if start.stance.shift else V, h)

    def straying(self, now: Tree, body: int) -> tuple[Mat3, Vec3]:
        """As `strayed`, of all points of a body, given where they are now, about O: D and c of D x + c."""
        X, X_old, omega = now.X[body], self.tree.X[body], self.W[body].angular * self.h
        turn = Mat3.identity() + Mat3.skew(omega)
        N = turn @ (Mat3.identity() @ X_old.R).times_transpose(Mat3.identity() @ X.R)
        moved = now.origin - self.tree.origin - self.W[body].linear * self.h
        return Mat3.identity() - N, moved - turn @ X_old.p + N @ X.p

    def strayed(self, now: Tree, body: int, point: Vec3) -> Vec3:
        """How far a point of a body, in its axes, has come besides what its velocity was: the sag of its arc."""
        old = self.tree.X[body].transform_point(point)
        straight = self.W[body].linear + self.W[body].angular.cross(old)
        moved = now.X[body].transform_point(point) - old + (now.origin - self.tree.origin)
        return moved - straight * self.h


def momenta(now: Tree, past: Past, forces: Forces, h: Scalar) -> list[Force]:
    """F: of each body, about O: what it had a step ago, and what gravity and external wrenches give it in this one.

    Args:
        now: the tree at q.
        past: how it got there.
        forces: what acts.
        h: length of the step.
    """
    mechanism, before, V = now.mechanism, past.tree, past.V
    fall = Vec3.of(forces.gravity) * h
    F: list[Force] = []
    for i, inertia in enumerate(mechanism.inertia):
        R_WB = before.X[i].R
        at_center = V[i].linear + V[i].angular.cross(before.center(i))
        linear = (at_center + fall) * inertia.mass
        spin = R_WB @ (about_center(inertia) @ R_WB.transpose_times(V[i].angular))
        F.append(force_at(now.center(i), linear, spin))
    for (i, X_BL), wrench in zip(mechanism.links, forces.external or (), strict=bool(forces.external)):
        if i != WORLD:
            linear, couple = Vec3.of(wrench[:3]) * h, Vec3.of(wrench[3:]) * h
            F[i] = F[i] + force_at(now.X[i].transform_point(X_BL.p), linear, couple)
    return F
