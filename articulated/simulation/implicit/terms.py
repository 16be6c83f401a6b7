"""The terms of a step's problem: contacts of bodies with the ground, and what acts on joints by a law of one direction.

A term sees its own velocity u (three components in world axes, or one), and answers with an impulse g(u) and its slope G(u).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.dynamics.loops.closure import Line
from articulated.dynamics.mechanism import WORLD
from articulated.scalar import Scalar, absolute, maximum, where
from articulated.simulation.implicit.laws import Cone, Drive, Hinge, dot
from articulated.spatial import ArticulatedInertia, Force, Mat3, Motion, Sym3, Vec3

SLIP_SPEED = 1e-3
"""Width of the friction cone [m/s, rad/s]: from here on it slides. What holds still does not creep: see `Stance.anchors`."""
SIGMA = 1e-3
"""Friction that holds is at most as hard as 1/σ of the mass that is felt: Castro et al. 2022 (SAP), eq. 21 and 22."""
NEAR_RIGID = 39.47841760435743
"""4π²: in a step, a spring acts at most as hard as one of this period on the mass that is felt: SAP, eq. 20, β = 1."""

_TINY = 1e-30
_NOTHING = Vec3.zero()


@dataclass(eq=False)
class Reaction:
    """What a contact answers: g, and G = s (1 − n nᵀ) − bend t tᵀ + along n nᵀ."""

    SIZE = 9

    g: Vec3
    s: Scalar
    bend: Scalar
    t: Vec3
    along: Scalar
    n: Vec3

    def numbers(self) -> list[Scalar]:
        """All but n."""
        return [*self.g, self.s, self.bend, *self.t, self.along]

    @staticmethod
    def of(numbers: Sequence[Scalar], n: Vec3) -> Reaction:
        """The reverse of `numbers`."""
        return Reaction(Vec3.of(numbers[:3]), numbers[3], numbers[4], Vec3.of(numbers[5:8]), numbers[8], n)

    def slope(self) -> Sym3:
        """G."""
        G, n, t = Sym3.scaled_identity(self.s), self.n, self.t
        return G.minus_outer(n, n * (self.s - self.along)).minus_outer(t, t * self.bend)

    def times(self, u: Vec3) -> Vec3:
        """G u."""
        un = self.n.dot(u)
        return u * self.s + self.n * ((self.along - self.s) * un) - self.t * (self.bend * self.t.dot(u))


@dataclass(frozen=True, eq=False)
class Bend:
    """How a term's potential bends along a line.

    Attributes:
        second: its second derivative.
        past: how far back the point of least slip is, in lengths of du: there friction turns round within a narrow band.
        pull: square of friction's slope, 0 if it is in that band.
    """

    second: Scalar
    past: Scalar
    pull: Scalar


@dataclass(frozen=True, eq=False)
class Contact:
    """A point of a body that may touch the ground, or another body; SIZE numbers, but for its bodies and the ground.

    Attributes:
        body: which.
        r: the point, about O.
        n: the normal of what it touches, there.
        hinge: the law along n.
        anchor: tangential velocity that would undo the stretch of the spring that holds the point.
        ground: the ground's own velocity there.
        friction: coefficient.
        w: how much velocity an impulse gives the point, about [1/kg].
        near: mask: whether it can touch in this step. If not it answers nothing, and its other numbers are not defined.
        other: the body that it may touch, if that moves.
        already: impulse that it gives besides, whatever u is.
    """

    SIZE = 19

    body: int
    r: Vec3
    n: Vec3
    hinge: Hinge
    anchor: Vec3
    ground: Vec3
    friction: Scalar
    w: Scalar
    near: Scalar
    other: int = WORLD
    already: Vec3 = _NOTHING

    def numbers(self) -> list[Scalar]:
        """All that it is but its bodies and the ground: of contacts between pieces."""
        h = self.hinge
        alone = [self.friction, self.w, h.a, h.b, h.c, h.d]
        return [where(self.near, 1.0, 0.0), *alone, *self.r, *self.n, *self.anchor, *self.already]

    @staticmethod
    def of(numbers: Sequence[Scalar]) -> Contact:
        """The reverse of `numbers`; of no bodies."""
        near, friction, w, a, b, c, d, *vectors = numbers
        r, n, anchor, already = (Vec3.of(vectors[k : k + 3]) for k in (0, 3, 6, 9))
        return Contact(WORLD, r, n, Hinge(a, b, d, c), anchor, Vec3.zero(), friction, w, near > 0.5, WORLD, already)

    def velocity(self, own: Motion, other: Motion) -> Vec3:
        """u, relative to what it touches, for the velocities of both bodies; the ground's is 0."""
        motion = own - other
        return motion.linear + motion.angular.cross(self.r) - self.ground

    def stopping(self, un: Scalar) -> Scalar:
        """About the impulse that it takes to stop what comes with this velocity: for what did not push a sweep before."""
        hinge = self.hinge
        stopped = (hinge.a / hinge.b - un) * (1.0 / (1.0 / hinge.b + self.w))
        return where(hinge.push(un) > 0.0, stopped, 0.0)

    def width(self, limit: Scalar) -> Scalar:
        """Of the friction cone."""
        return maximum((SIGMA * self.w) * limit, SLIP_SPEED)

    def pull(self, u: Vec3) -> Vec3:
        """What friction answers to: tangential velocity and the anchor's."""
        return u - self.n * self.n.dot(u) + self.anchor

    def reaction(self, u: Vec3, limit: Scalar, theta: Scalar) -> Reaction:
        """g and G; `limit` is of the friction cone."""
        x = self.pull(u)
        s, sliding = Cone(limit, self.width(limit)).secant(x.dot(x))
        push, along = self.hinge.push_and_slope(self.n.dot(u))
        return Reaction(x * s - self.n * push - self.already, s, theta * s, x * sliding, along, self.n)

    def act(self, reaction: Reaction, u: Vec3) -> tuple[ArticulatedInertia, Force]:
        """What it adds to its body's inertia and bias: G, and g − G u, with u in the world, or in the other body."""
        G, r = reaction.slope(), Mat3.skew(self.r)
        H = r @ G.as_matrix()
        b = reaction.g - reaction.times(u + self.ground)
        return ArticulatedInertia(Sym3.upper_of_product(H, r), H, G), Force(self.r.cross(b), b)

    def answer(self, u: Vec3, y: Vec3, limit: Scalar) -> tuple[Vec3, Scalar]:
        """g(u) − y, and its square weighted by how much velocity an impulse gives where G resists it too [m²/s² kg]."""
        x, un = self.pull(u), self.n.dot(u)
        s, sliding = Cone(limit, self.width(limit)).secant(x.dot(x))
        push, along = self.hinge.push_and_slope(un)
        y = y + self.already
        yn = self.n.dot(y)
        across, off = x * s - (y - self.n * yn), push + yn
        mass = 1.0 / self.w
        hard, stiff = mass + along, mass + where(sliding > 0.0, 0.0, s)
        square = (across.dot(across) * hard + off * off * stiff) / (hard * stiff)
        return across - self.n * off, square

    def bend(self, u: Vec3, du: Vec3, limit: Scalar) -> Bend:
        """Of the potential along du."""
        x, un = self.pull(u), self.n.dot(du)
        s, sliding = Cone(limit, self.width(limit)).secant(x.dot(x))
        _, along = self.hinge.push_and_slope(self.n.dot(u))
        dt = du - self.n * un
        towards, square = x.dot(dt), dt.dot(dt)
        turned = towards * sliding
        pull = limit * turned
        return Bend(s * (square - turned * turned) + along * (un * un), towards / maximum(square, _TINY), pull * pull)


@dataclass(frozen=True, eq=False)
class JointTerm:
    """What acts along one direction of a joint, or along a rope.

    Attributes:
        direction: velocity along it, by coordinate: u = Σ c_s v_s.
        stops: hinges, each with the sign of the direction in which it pushes.
        drive: a motor with a limited torque, or None.
        dry: a friction cone and the anchor's velocity, or None.
        w: how much velocity an impulse gives, about [1/kg or 1/(kg m²)].
        near: as of a contact; True if there is more than stops.
        rope: its row, and the number of that among all rows of loops.
        already: as of a contact.
    """

    direction: dict[int, Scalar]
    stops: tuple[tuple[float, Hinge], ...]
    drive: Drive | None
    dry: tuple[Cone, Scalar] | None
    w: float
    near: Scalar
    rope: tuple[int, Line] | None = None
    already: Scalar = 0.0

    def velocity(self, V: Sequence[Motion], v: Sequence[Scalar]) -> Scalar:
        """u."""
        if self.rope is not None:
            return self.rope[1].speed(V, v)
        return dot(list(self.direction.values()), [v[s] for s in self.direction])

    def reaction(self, u: Scalar, theta: Scalar) -> tuple[Scalar, Scalar]:
        """g and G."""
        g, G = -self.already, 0.0
        for sign, hinge in self.stops:
            push, slope = hinge.push_and_slope(u * sign)
            g, G = g - push * sign, G + slope
        if self.drive is not None:
            given, slope = self.drive.at(u, theta)
            g, G = g + given, G + slope
        if self.dry is not None:
            cone, anchor = self.dry
            given, slope = cone.at(u + anchor, theta)
            g, G = g + given, G + slope
        return g, G

    def answer(self, u: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
        """As of a contact."""
        g, G = self.reaction(u, 1.0)
        off = g - y
        return off, off * off / (1.0 / self.w + G)

    def bend(self, u: Scalar, du: Scalar) -> Bend:
        """As of a contact."""
        second = self.reaction(u, 1.0)[1] * (du * du)
        if self.dry is None:
            return Bend(second, 0.0, 0.0)
        cone, anchor = self.dry
        x = u + anchor
        pull = cone.limit * du * where(absolute(x) > cone.width, 1.0, 0.0)
        return Bend(second, x * du / maximum(du * du, _TINY), pull * pull)
