"""All that decides how a rig moves but the state and the forces: what a step is compiled from.

What is compiled in is structure: the rig, where it may touch, what kinds of ground and of drives there are. Numbers that users
turn, such as friction and gains, are arguments of what was compiled: changing them costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from articulated.compiler import evaluate
from articulated.dynamics.loops.closure import Closure, lines, sizes
from articulated.dynamics.loops.constrained import jacobian_rows
from articulated.dynamics.mass_matrix import mass_matrix
from articulated.dynamics.mechanism import WORLD, Mechanism, TreeJoint, content, mechanism
from articulated.dynamics.together import fill
from articulated.dynamics.tree import Tree, tree
from articulated.rig import Limits, Rig
from articulated.scalar import Scalar
from articulated.simulation.contact.candidates import Candidate
from articulated.simulation.contact.meeting import Pair, count
from articulated.simulation.contact.pieces import Piece, stand
from articulated.simulation.contact.surfaces import HeightField, Solid
from articulated.spatial import Vec3

_UNLIMITED = 1e6
"""A position limit beyond this [rad or m] is a file's way to say that there is none."""
MOST_FILL = 22_000
"""Multiply-adds for factoring a step's linear system, of fifty coordinates that all touch each other: beyond, it is solved by
conjugate gradients."""


@dataclass(frozen=True)
class Drives:
    """Which coordinates have a proportional-derivative drive, and whether its torque is limited."""

    coordinates: tuple[int, ...]
    limited: bool


@dataclass(frozen=True, eq=False)
class Scene:
    """See above.

    Attributes:
        rig: the rig.
        surfaces: of the ground.
        candidates: what may touch it.
        material: for each candidate which of the materials is its own.
        materials: how many there are.
        velocity: of the ground.
        rebounds: whether any material has a restitution.
        stops: whether joint limits are stops.
        drives: what moves joints, or None.
        loops: what closes the rig.
        ropes: loops that only ever pull.
        pieces: convex shapes of the rig and of what stands around.
        pairs: which of these may touch each other.
        carriers: of each lot of particles that it carries, the bodies that do.
    """

    rig: Rig
    surfaces: tuple[Solid, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    material: tuple[int, ...] = ()
    materials: int = 0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rebounds: bool = False
    stops: bool = False
    drives: Drives | None = None
    loops: tuple[Closure, ...] = ()
    ropes: tuple[Closure, ...] = ()
    pieces: tuple[Piece, ...] = ()
    pairs: tuple[Pair, ...] = ()
    carriers: tuple[tuple[int, ...], ...] = ()

    @cached_property
    def mechanism(self) -> Mechanism:
        return mechanism(self.rig)

    @cached_property
    def content(self) -> bytes:
        """All that it is made of: scenes of equal content move alike."""
        # of height fields only where their points stand: the heights are given at run time
        surfaces = [(s.heights.shape, s.spacing, s.origin) if isinstance(s, HeightField) else s for s in self.surfaces]
        parts = surfaces, self.candidates, self.material, self.materials, self.velocity, self.rebounds, self.stops
        limits = [(self.rig.lower[s], self.rig.upper[s]) for s in self.stopped]
        limits += [(joint.name, (own := self.rig.joints[joint.name].limits).upper, own.ball) for joint in self.cones]
        parts = *parts, self.drives, limits, self.loops, self.ropes, self.pieces, self.pairs, self.iterates, self.carriers
        return repr(parts).encode() + content(self.rig)

    @property
    def is_one_sided(self) -> bool:
        """Whether a step is more than a linear system."""
        limited = self.drives is not None and self.drives.limited
        one_sided = self.contacts or self.stopped or self.cones or self.ropes
        return bool(one_sided or limited or any(self.mechanism.friction))

    @property
    def is_stiff(self) -> bool:
        """Whether anything in it is that an explicit method may not get over."""
        m = self.mechanism
        one_sided = self.contacts or self.stopped or self.cones or self.ropes
        return bool(one_sided or self.drives or self.carriers or any(m.damping) or any(m.friction))

    @property
    def tables(self) -> list[np.ndarray]:
        """The heights of each height field, flat."""
        return [np.ravel(surface.heights) for surface in self.surfaces if isinstance(surface, HeightField)]

    @property
    def touches(self) -> int:
        """How many contacts with the ground there can be: each candidate's with each surface, surfaces counting faster."""
        return len(self.candidates) * len(self.surfaces)

    @property
    def contacts(self) -> int:
        """And how many in all: with the ground, then those of pairs."""
        return self.touches + len(self.pair_of)

    @cached_property
    def pair_of(self) -> list[Pair]:
        """Of each contact between two pieces."""
        return [pair for pair in self.pairs for _ in range(self.points_of(pair))]

    @cached_property
    def couplings(self) -> list[tuple[int, int]]:
        """Bodies between which contacts may act."""
        return list(dict.fromkeys(ends for pair in self.pairs if WORLD not in (ends := self.ends(pair))))

    @cached_property
    def iterates(self) -> bool:
        """Whether contacts between bodies are too many for a direct solution of a step's linear system."""
        return fill(self.mechanism, self.couplings) > MOST_FILL

    def points_of(self, pair: Pair) -> int:
        """In how many points it may touch at once."""
        return count(self.pieces[pair.a], self.pieces[pair.b])

    def candidate_of(self, n: int) -> int:
        """Of the n-th contact."""
        return n // len(self.surfaces)

    def surface_of(self, n: int) -> Solid:
        """Of the n-th contact."""
        return self.surfaces[n % len(self.surfaces)]

    def body_of(self, n: int) -> int:
        """Of the n-th contact."""
        if n >= self.touches:
            return self.ends(self.pair_of[n - self.touches])[0]
        return self.mechanism.links[self.candidates[self.candidate_of(n)].link][0]

    def other_of(self, n: int) -> int:
        """The other body of the n-th contact."""
        return WORLD if n < self.touches else self.ends(self.pair_of[n - self.touches])[1]

    def material_of(self, n: int) -> int:
        """Of the n-th contact."""
        return self.material[self.candidate_of(n)] if n < self.touches else self.pair_of[n - self.touches].material

    def ends(self, pair: Pair) -> tuple[int, int]:
        """The bodies of a pair."""
        return self.pieces[pair.a].body(self.mechanism), self.pieces[pair.b].body(self.mechanism)

    @cached_property
    def stopped(self) -> list[int]:
        """Coordinates with position limits that are enforced."""
        if not self.stops:
            return []
        inside = (self.rig.lower > -_UNLIMITED) | (self.rig.upper < _UNLIMITED)
        return np.flatnonzero(inside).tolist()

    @cached_property
    def cones(self) -> list[TreeJoint]:
        """Ball joints that may only turn so far, which is enforced."""
        joints = self.rig.joints
        balls = [j for j in self.mechanism.own_joints() if joints[j.name].kind == "ball"]
        return [j for j in balls if self.stops and _ends(joints[j.name].limits)]

    def felt(self, n: int) -> float:
        """How much velocity an impulse at the n-th contact gives, on average over directions, the rig neutral [1/kg]."""
        if n >= self.touches:
            return self._felt_between[self.pair_of[n - self.touches]]
        m, now, candidate = self.mechanism, self._neutral, self.candidates[self.candidate_of(n)]
        body, X_BL = m.links[candidate.link]
        r = np.array(list((now.X[body] @ X_BL).transform_point(Vec3.of(candidate.center))))
        return float(self._felt_along(self._point_jacobian(body, r[None]))[0])

    @cached_property
    def _felt_between(self) -> dict[Pair, float]:
        """Likewise between two pieces, on average over points of their surfaces, too [1/kg]."""
        now, result = self._neutral, {}
        for pair in self.pairs:
            J = [np.zeros((1, 3, self.mechanism.nv))] * 2
            for k, (piece, body) in enumerate(zip((pair.a, pair.b), self.ends(pair), strict=True)):
                if body != WORLD:
                    R, p = stand(now, self.pieces[piece])
                    r = self.pieces[piece].corners @ np.array([list(row) for row in R.rows]).T + np.array(list(p))
                    J[k] = self._point_jacobian(body, r)
            between = (J[0][:, None] - J[1][None]).reshape(-1, 3, self.mechanism.nv)
            result[pair] = float(self._felt_along(between).mean())
        return result

    def _point_jacobian(self, body: int, r: np.ndarray) -> np.ndarray:
        """Of points of a body, about O, shape (n, 3): how coordinates move them where the rig is neutral, shape (n, 3, nv)."""
        m, now = self.mechanism, self._neutral
        J = np.zeros((len(r), 3, m.nv))
        for i in m.support(body):
            for column, s in zip(now.S[i], m.joints[i].v, strict=True):
                J[:, :, s] += np.array(list(column.linear)) + np.cross(list(column.angular), r)
        return J

    def _felt_along(self, J: np.ndarray) -> np.ndarray:
        """How much velocity an impulse gives, on average over three directions, shapes (n, 3, nv) and (n,) [1/kg]."""
        given = np.einsum("nia,ab,nib->ni", J, self._inverse_mass, J, optimize=True)
        return np.linalg.norm(given, axis=1) / np.sqrt(3.0)

    def rope_felt(self, rope: Closure) -> float:
        """Likewise between the ends of a rope, on average over directions [1/kg]."""
        q, point = self.rig.neutral().tolist(), replace(rope, kind="point", one_sided=False)
        J = np.array(jacobian_rows(self._neutral, lines(self._neutral, q, [point])))
        return float(np.trace(J @ self._inverse_mass @ J.T) / 3.0)

    @property
    def sizes(self) -> list[int]:
        """How many rows each loop has, ropes last."""
        return sizes((*self.loops, *self.ropes))

    @property
    def rows(self) -> list[str]:
        """A name for each row of loops, ropes' last."""
        return [label for closure in (*self.loops, *self.ropes) for label in closure.labels]

    def joint_felt(self, coordinates: Sequence[int]) -> float:
        """Likewise along coordinates of a joint [1/kg or 1/(kg m²)]."""
        return float(np.mean([self._inverse_mass[s, s] for s in coordinates]))

    @cached_property
    def ease(self) -> list[float]:
        """How much velocity a force on each coordinate gives, likewise; of balls and free bodies the same in all directions."""
        ease = np.diag(self._inverse_mass).copy()
        for joint in self.mechanism.own_joints():
            for part in (joint.v[:3], joint.v[3:]):
                if len(joint.v) in (3, 6):
                    ease[list(part)] = ease[list(part)].mean() if part else 0.0
        return ease.tolist()

    @cached_property
    def _neutral(self) -> Tree:
        return tree(self.mechanism, self.rig.neutral().tolist())

    @cached_property
    def _inverse_mass(self) -> np.ndarray:
        """M⁻¹ where the rig is neutral; a free root's axes are the world's there."""
        m = self.mechanism
        M = np.empty((m.nv, m.nv))
        evaluate(lambda q: mass_matrix(m, q), [(self.rig.neutral(), 1)], M, ())
        return np.linalg.inv(M)


def _ends(limits: Limits) -> bool:
    """Whether a ball joint may not turn all the way."""
    return limits.upper < math.pi or (limits.ball is not None and (limits.ball.swings or limits.ball.twists))


@dataclass(frozen=True)
class MaterialNumbers:
    """Of a `Material`, its stiffness filled in."""

    friction: Scalar
    restitution: Scalar
    stiffness: Scalar
    dissipation: Scalar


@dataclass(frozen=True)
class DriveNumbers:
    """Gains and limits of each drive."""

    stiffness: list[Scalar] = field(default_factory=list)
    damping: list[Scalar] = field(default_factory=list)
    limit: list[Scalar] = field(default_factory=list)


@dataclass(frozen=True)
class Numbers:
    """The numbers that users turn.

    Attributes:
        materials: of each.
        stop_stiffness: of joint limits, over the inertia that is felt there [1/s²].
        stop_dissipation, stop_restitution: of joint limits.
        drives: of each drive.
        tolerance: of the solver [m/s].
    """

    materials: list[MaterialNumbers] = field(default_factory=list)
    stop_stiffness: Scalar = 0.0
    stop_dissipation: Scalar = 0.0
    stop_restitution: Scalar = 0.0
    drives: DriveNumbers = field(default_factory=DriveNumbers)
    tolerance: Scalar = 1e-4
