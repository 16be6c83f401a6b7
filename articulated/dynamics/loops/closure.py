"""What loops ask of a rig: that some functions φ of its configuration stay 0; and how fast these change.

Of two frames A and B, all rows are products of a direction fixed in A with one fixed in B, or with the way d between the two
origins: Haug, Computer-Aided Kinematics and Dynamics of Mechanical Systems, 1989, 9.4 (his dot-1 and dot-2).

symbol   meaning                                                         unit
d        from A's origin to B's
φ        n·m for directions n of A, m of B; n·d; or |d| less a length    1 or m
K        wrench on B's body for a unit of a row's force, about O:        1
         φ̇ = K · (V_B − V_A), and A's body feels −K

What acts on A acts at B's origin too, however far the loop is open: so no loop changes a momentum.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.dynamics.tree import Tree
from articulated.rig import Rig
from articulated.rig.fit import check_loop, is_world
from articulated.rig.loop import KINDS, Loop
from articulated.scalar import Scalar, maximum, sqrt
from articulated.spatial import Force, Mat3, Motion, Pose, Vec3

_TINY = 1e-30
_X, _Y, _Z = range(3)

_PLACES: dict[str, tuple[int, ...]] = {
    "point": (_X, _Y, _Z),
    "hinge": (_X, _Y, _Z),
    "slider": (_X, _Y),
    "universal": (_X, _Y, _Z),
    "cylindrical": (_X, _Y),
    "planar": (_Z,),
    "weld": (_X, _Y, _Z),
}
"""Directions of A along which the origins keep together."""

_TILT = ((_Z, _Y, 1.0), (_Z, _X, -1.0))
_ALL = ((_Z, _Y, 1.0), (_X, _Z, 1.0), (_Y, _X, 1.0))
_RIGHT_ANGLES: dict[str, tuple[tuple[int, int, float], ...]] = {
    "hinge": _TILT,
    "slider": _ALL,
    "universal": ((_Z, _Z, 1.0),),
    "cylindrical": _TILT,
    "planar": _TILT,
    "weld": _ALL,
}
"""Directions of A and of B that keep at right angles, and a sign: so that a turn of B about A's x, y or z makes φ grow."""


@dataclass(frozen=True)
class Closure:
    """A loop as algorithms see it: plain numbers, so that equal loops are equal and can be told apart by them.

    Attributes:
        name, kind: of the loop.
        ends: indices of the links of A and B, `WORLD` for the world; of a gear, of the joints that have the coordinates.
        frames: A and B in their links, row by row.
        length: of a distance.
        one_sided: whether that may be less.
        ratios: of a gear, what the two coordinates are multiplied by; and what their sum is to be.
    """

    name: str
    kind: str
    ends: tuple[int, int]
    frames: tuple[tuple[tuple[float, ...], ...], ...]
    length: float
    one_sided: bool
    ratios: tuple[float, float, float]

    @property
    def size(self) -> int:
        """How many rows it has."""
        return len(KINDS[self.kind])

    @property
    def labels(self) -> list[str]:
        """A name for each row."""
        return [f"{self.name}: {'rope' if self.one_sided else row}" for row in KINDS[self.kind]]


def closures(rig: Rig, loops: Sequence[Loop]) -> tuple[Closure, ...]:
    """Loops of a rig as algorithms see them.

    Raises:
        ValueError: one does not fit the rig.
    """
    for loop in loops:
        check_loop(rig, loop)
    return tuple(_geared(rig, loop) if loop.kind == "gear" else _closure(rig, loop) for loop in loops)


def sizes(some: Sequence[Closure]) -> list[int]:
    """How many rows each of some loops has."""
    return [closure.size for closure in some]


def _closure(rig: Rig, loop: Loop) -> Closure:
    a, b = (WORLD if is_world(rig, name) else rig.links[str(name)].index for name in (loop.link_a, loop.link_b))
    frames = tuple(tuple(tuple(row) for row in frame.tolist()) for frame in loop.frames)
    return Closure(loop.name, loop.kind, (a, b), frames, loop.length or 0.0, loop.rope, (0.0, 0.0, 0.0))


def _geared(rig: Rig, loop: Loop) -> Closure:
    """A follower's coordinate is its leader's: ratio and offset are those of the leaders then."""
    names = list(rig.joints)
    ends, ratios, rest = [], [], loop.offset
    for name, factor in ((str(loop.link_a), -float(loop.ratio or 0.0)), (str(loop.link_b), 1.0)):
        mimic = rig.joints[name].mimic
        if mimic is not None:
            rest, factor, name = rest - factor * mimic.offset, factor * mimic.multiplier, mimic.joint
        ends.append(names.index(name))
        ratios.append(factor)
    return Closure(loop.name, loop.kind, (ends[0], ends[1]), (), 0.0, False, (ratios[0], ratios[1], rest))


@dataclass(frozen=True, eq=False)
class End:
    """One end of a loop: its body (or `WORLD`), its axes, and its origin about O."""

    body: int
    axes: list[Vec3]
    origin: Vec3


@dataclass(frozen=True, eq=False)
class Line:
    """One row of a loop, at one configuration.

    Attributes:
        gap: φ.
        a, b: bodies of A and B.
        K: see above; None of a gear.
        turns: of a gear: the coordinates that it ties, and their factors.
    """

    gap: Scalar
    a: int
    b: int
    K: Force | None
    turns: dict[int, float]

    def speed(self, V: Sequence[Motion], v: Sequence[Scalar]) -> Scalar:
        """φ̇, for velocities of bodies and coordinates."""
        if self.K is None:
            return sum((factor * v[s] for s, factor in self.turns.items()), 0.0)
        return _difference(V, self.a, self.b).dot(self.K)

    def curvature(self, V: Sequence[Motion], A: Sequence[Motion]) -> Scalar:
        """φ̈ where no coordinate accelerates: `A` are the bodies' spatial accelerations then."""
        return 0.0 if self.K is None else _difference(A, self.a, self.b).dot(self.K) + self._bend(V)

    def _bend(self, V: Sequence[Motion]) -> Scalar:
        """What there is of it even if no body accelerates."""
        return 0.0


@dataclass(frozen=True, eq=False)
class RightAngle(Line):
    """n·m, of directions of A and B."""

    n: Vec3
    m: Vec3

    def _bend(self, V: Sequence[Motion]) -> Scalar:
        w_a, w_b = (V[i].angular if i != WORLD else Vec3.zero() for i in (self.a, self.b))
        n, m = w_a.cross(self.n), w_b.cross(self.m)
        return w_a.cross(n).dot(self.m) + 2.0 * n.dot(m) + self.n.dot(w_b.cross(m))


@dataclass(frozen=True, eq=False)
class Way(Line):
    """n·d, of a direction of A; B's origin is r."""

    n: Vec3
    d: Vec3
    r: Vec3

    def _bend(self, V: Sequence[Motion]) -> Scalar:
        w_a = V[self.a].angular if self.a != WORLD else Vec3.zero()
        d1, d2 = _parting(V, self.a, self.b, self.d, self.r)
        n = w_a.cross(self.n)
        return self.n.dot(d2) + 2.0 * n.dot(d1) + w_a.cross(n).dot(self.d)


@dataclass(frozen=True, eq=False)
class Distance(Line):
    """|d| less a length; B's origin is r."""

    d: Vec3
    r: Vec3

    def _bend(self, V: Sequence[Motion]) -> Scalar:
        d1, d2 = _parting(V, self.a, self.b, self.d, self.r)
        square, along = maximum(self.d.dot(self.d), _TINY), self.d.dot(d1)
        return (self.d.dot(d2) + d1.dot(d1) - along * along / square) / sqrt(square)


def lines(now: Tree, q: Sequence[Scalar], some: Sequence[Closure]) -> list[Line]:
    """All rows of some loops."""
    return [line for closure in some for line in _lines(now, q, closure)]


def jacobian(now: Tree, rows: Sequence[Line]) -> list[dict[int, Scalar]]:
    """J: what each coordinate's velocity adds to each row's speed, free roots' in world axes.

    Coordinates that add nothing are left out, such as those that move both ends alike.
    """
    m = now.mechanism
    J: list[dict[int, Scalar]] = []
    for line in rows:
        row: dict[int, Scalar] = dict(line.turns)
        ways = m.support(line.a), m.support(line.b)
        for way, sign in zip(ways, (-1.0, 1.0), strict=True):
            for i in way:
                if line.K is not None and not (i in ways[0] and i in ways[1]):
                    for column, s in zip(now.S[i], m.joints[i].v, strict=True):
                        x = column.dot(line.K) * sign
                        row[s] = row[s] + x if s in row else x
        J.append(row)
    return J


def _lines(now: Tree, q: Sequence[Scalar], closure: Closure) -> Iterator[Line]:
    if closure.kind == "gear":
        yield _gear(now.mechanism, q, closure)
        return
    A, B = (_end(now, k, frame) for k, frame in zip(closure.ends, closure.frames, strict=True))
    bodies, d, r = (A.body, B.body), B.origin - A.origin, B.origin
    if closure.kind == "distance":
        size = sqrt(maximum(d.dot(d), _TINY))
        e = d * (1.0 / size)
        yield Distance(size - closure.length, *bodies, Force(r.cross(e), e), {}, d, r)
    for k in _PLACES.get(closure.kind, ()):
        n = A.axes[k]
        yield Way(n.dot(d), *bodies, Force(r.cross(n), n), {}, n, d, r)
    for j, k, sign in _RIGHT_ANGLES.get(closure.kind, ()):
        n, axis = A.axes[j] * sign, B.axes[k]
        yield RightAngle(n.dot(axis), *bodies, Force(axis.cross(n), Vec3.zero()), {}, n, axis)


def _gear(m: Mechanism, q: Sequence[Scalar], closure: Closure) -> Line:
    names, own = list(m.rig.joints), {joint.name: joint for joint in m.own_joints()}
    joints = [own[names[k]] for k in closure.ends]
    *factors, rest = closure.ratios
    gap = sum((q[j.q[0]] * x for j, x in zip(joints, factors, strict=True)), -rest)
    return Line(gap, WORLD, WORLD, None, {j.v[0]: x for j, x in zip(joints, factors, strict=True)})


def _end(now: Tree, link: int, frame: Sequence[Sequence[float]]) -> End:
    R = Mat3.of([list(row[:3]) for row in frame[:3]])
    p = Vec3.of([row[3] for row in frame[:3]])
    body, X_BL = now.mechanism.links[link] if link != WORLD else (WORLD, Pose.identity())
    axes, p = [X_BL.R @ axis for axis in R.T.rows], X_BL.transform_point(p)
    if body == WORLD:
        return End(WORLD, axes, p - now.origin)
    return End(body, [now.X[body].R @ axis for axis in axes], now.X[body].transform_point(p))


def _difference(V: Sequence[Motion], a: int, b: int) -> Motion:
    if a == WORLD:
        return V[b]
    return V[b] - V[a] if b != WORLD else V[a] * -1.0


def _parting(V: Sequence[Motion], a: int, b: int, d: Vec3, r: Vec3) -> tuple[Vec3, Vec3]:
    """ḋ, and d̈ where no body accelerates but its points do, ω × u."""
    (u_a, c_a), (u_b, c_b) = _at(V, a, r - d), _at(V, b, r)
    return u_b - u_a, c_b - c_a


def _at(V: Sequence[Motion], body: int, r: Vec3) -> tuple[Vec3, Vec3]:
    """The velocity u of a point of a body, and ω × u."""
    if body == WORLD:
        return Vec3.zero(), Vec3.zero()
    u = V[body].linear + V[body].angular.cross(r)
    return u, V[body].angular.cross(u)
