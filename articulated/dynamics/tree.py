"""A tree of bodies in world axes about one common origin: there, what bodies add up to needs no rotations and no shifts.

symbol   meaning                                                        RBDA
O        the common origin: where the first free root stands, else the world's
X        X_OB, pose of a body, in world axes about O
S        motion of a body for each coordinate of its joint, (a, o × a)  3.33
V        velocity of a body, in world axes about O                      5.7
F        momentum of a body, likewise                                   2.61

Generalized velocities are as everywhere, but for free roots: of their origins, in world axes too. The first one's S is the
identity then.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from articulated.dynamics.kinematics import combination, placements
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar, is_zero
from articulated.spatial import Force, Mat3, Motion, Pose, RigidInertia, Sym3, UnitMotion, Vec3

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

    def accelerations(self, q: Sequence[Scalar], v: Sequence[Scalar], V: Sequence[Motion], straight: bool) -> list[Motion]:
        """Spatial accelerations of all bodies, in world axes about O, where no coordinate accelerates, RBDA 4.5.

        `straight`: a free root moves straight then, and not along its own axes as they turn.
        """
        A: list[Motion] = []
        for i, (p, joint) in enumerate(zip(self.mechanism.parent, self.mechanism.joints, strict=True)):
            if i in self.mechanism.free_roots:
                bent = V[i].angular.cross(V[i].linear + V[i].angular.cross(self.X[i].p))
                A.append(Motion(Vec3.zero(), -bent) if straight else Motion.zero())
                continue
            own = V[i].cross(combination(self.S[i], [v[k] for k in joint.v]))
            if (product := joint.model.velocity_product(joint.configuration(q), joint.velocity(v))) is not None:
                own = own + self.X[i].motion_to_parent(product)
            A.append(own if p == WORLD else A[p] + own)
        return A

    def out_of_world(self, v: Sequence[Scalar]) -> list[Scalar]:
        """Generalized velocities, or forces, with free roots' in their own axes: the reverse of `in_world`."""
        return _roots_turned(self.mechanism, v, lambda i, part: (Mat3.identity() @ self.X[i].R).transpose_times(part))

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
    roots, moved = mechanism.free_roots, placements(mechanism, q)
    origin = moved[roots[0]].p if roots else Vec3.zero()
    X: list[Pose] = []
    S: list[list[Motion]] = []
    for i, (p, joint) in enumerate(zip(mechanism.parent, mechanism.joints, strict=True)):
        if p != WORLD:
            X.append(X[p] @ moved[i])
        else:
            X.append(Pose(Mat3.identity() @ moved[i].R, Vec3.zero() if i in roots[:1] else moved[i].p - origin))
        S.append(_world_axes(X[i].p) if i in roots else [X[i].motion_to_parent(column) for column in joint.subspace(q)])
    return Tree(mechanism, origin, X, S)


def along_coordinates(now: Tree, F: Sequence[Force]) -> list[Scalar]:
    """Σ Sᵀ F over each coordinate's subtree."""
    mechanism, total = now.mechanism, list(F)
    p: list[Scalar] = [0.0] * mechanism.nv
    for i in reversed(range(mechanism.nbodies)):
        for column, s in zip(now.S[i], mechanism.joints[i].v, strict=True):
            p[s] = p[s] + column.dot(total[i])
        if (parent := mechanism.parent[i]) != WORLD:
            total[parent] = total[parent] + total[i]
    return p


def in_world(now: Tree, v: Sequence[Scalar]) -> list[Scalar]:
    """Generalized velocities with free roots' in world axes."""
    return _roots_turned(now.mechanism, v, lambda i, part: now.X[i].R @ part)


def in_roots(mechanism: Mechanism, R_WB: Mapping[int, Mat3], v: Sequence[Scalar]) -> list[Scalar]:
    """The reverse of `in_world`, for roots with these rotations."""
    return _roots_turned(mechanism, v, lambda i, part: R_WB[i].transpose_times(part))


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


def _roots_turned(mechanism: Mechanism, v: Sequence[Scalar], turn: Callable[[int, Vec3], Vec3]) -> list[Scalar]:
    result = list(v)
    for i in mechanism.free_roots:
        first = mechanism.joints[i].v[0]
        for k in (first, first + 3):
            result[k : k + 3] = turn(i, Vec3.of(result[k : k + 3]))
    return result


def _world_axes(p: Vec3) -> list[Motion]:
    """The motions of a body at p, for its velocity there and for its turning, along world axes."""
    if all(is_zero(x) for x in p):
        return list(_WORLD_AXES)
    turns = [axis.angular for axis in _WORLD_AXES[3:]]
    return [*_WORLD_AXES[:3], *(Motion(axis, p.cross(axis)) for axis in turns)]


def force_at(point: Vec3, linear: Vec3, couple: Vec3) -> Force:
    """A force at a point and a couple, about O."""
    return Force(couple + point.cross(linear), linear)
