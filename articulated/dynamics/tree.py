"""A tree of bodies in world axes about one common origin: there, what bodies add up to needs no rotations and no shifts.

symbol   meaning                                                        RBDA
O        the common origin: where a free root stands, else the world's
X        X_OB, pose of a body, in world axes about O
S        motion of a body for each coordinate of its joint, (a, o × a)  3.33
V        velocity of a body, in world axes about O                      5.7
F        momentum of a body, likewise                                   2.61

Generalized velocities are as everywhere, but for a free root: its own, in world axes too. Then its S is the identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.dynamics.kinematics import combination, placements
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar
from articulated.spatial import Force, Mat3, Motion, Pose, RigidInertia, Sym3, UnitMotion, Vec3

ROOT = 0
"""The first body: the root's, if it is free."""

_WORLD_AXES = [UnitMotion(k) for k in (3, 4, 5, 0, 1, 2)]


@dataclass(frozen=True, eq=False)
class Tree:
    """The tree at one configuration; see the table above.

    Attributes:
        origin: O in the world.
    """

    mechanism: Mechanism
    origin: Vec3
    X: list[Pose]
    S: list[list[Motion]]

    def velocities(self, v: Sequence[Scalar]) -> list[Motion]:
        """V of all bodies."""
        V: list[Motion] = []
        for i, (p, joint) in enumerate(zip(self.mechanism.parent, self.mechanism.joints, strict=True)):
            own = combination(self.S[i], [v[k] for k in joint.v])
            V.append(own if p == WORLD else V[p] + own)
        return V

    def inertia(self, i: int) -> RigidInertia:
        """The inertia of a body: about its centre of mass, and of a point there, RBDA 2.62."""
        inertia, c = self.mechanism.inertia[i], self.center(i)
        h = c * inertia.mass
        return RigidInertia(inertia.mass, h, self.X[i].R.conjugate_symmetric(about_center(inertia)) + _of_point(h, c))

    def center(self, i: int) -> Vec3:
        """The centre of mass of a body."""
        return self.X[i].transform_point(center_of_mass(self.mechanism.inertia[i]))


def tree(mechanism: Mechanism, q: Sequence[Scalar]) -> Tree:
    """The tree at a configuration."""
    free, moved = is_free(mechanism), placements(mechanism, q)
    origin = moved[ROOT].p if free else Vec3.zero()
    X: list[Pose] = []
    S: list[list[Motion]] = []
    for i, (p, joint) in enumerate(zip(mechanism.parent, mechanism.joints, strict=True)):
        if p != WORLD:
            X.append(X[p] @ moved[i])
        else:
            X.append(Pose(Mat3.identity() @ moved[i].R, Vec3.zero() if free and i == ROOT else moved[i].p - origin))
        root = free and i == ROOT
        S.append(list(_WORLD_AXES) if root else [X[i].motion_to_parent(column) for column in joint.subspace(q)])
    return Tree(mechanism, origin, X, S)


def is_free(mechanism: Mechanism) -> bool:
    """Whether the first body floats in the world."""
    return mechanism.nbodies > 0 and mechanism.rig.joints[mechanism.joints[ROOT].name].kind == "floating"


def in_world(now: Tree, v: Sequence[Scalar]) -> list[Scalar]:
    """Generalized velocities with a free root's in world axes."""
    return _root_turned(now.mechanism, v, lambda part: now.X[ROOT].R @ part)


def in_root(mechanism: Mechanism, R_WB: Mat3, v: Sequence[Scalar]) -> list[Scalar]:
    """The reverse of `in_world`, for a root with this rotation."""
    return _root_turned(mechanism, v, R_WB.transpose_times)


def center_of_mass(inertia: RigidInertia) -> Vec3:
    """Of a body, in the body; its origin if it has no mass."""
    return inertia.h * (1.0 / inertia.mass) if inertia.mass > 0.0 else Vec3.zero()


def about_center(inertia: RigidInertia) -> Sym3:
    """The rotational inertia of a body about its centre of mass, in the body."""
    return inertia.J - _of_point(inertia.h, center_of_mass(inertia))


def _of_point(h: Vec3, c: Vec3) -> Sym3:
    """The rotational inertia of a point mass at c with the first moment h = m c."""
    x, y, z = h.x * c.x, h.y * c.y, h.z * c.z
    return Sym3(y + z, -(h.x * c.y), -(h.x * c.z), x + z, -(h.y * c.z), x + y)


def _root_turned(mechanism: Mechanism, v: Sequence[Scalar], turn) -> list[Scalar]:
    if not is_free(mechanism):
        return list(v)
    first = mechanism.joints[ROOT].v[0]
    linear, angular = (turn(Vec3.of(v[first + k : first + k + 3])) for k in (0, 3))
    return [*v[:first], *linear, *angular, *v[first + 6 :]]


def force_at(point: Vec3, linear: Vec3, couple: Vec3) -> Force:
    """A force at a point and a couple, about O."""
    return Force(couple + point.cross(linear), linear)
