"""The linear system (A + Jᵀ G J) v = p − Jᵀ (g − G u), by the articulated-body algorithm: O(n).

A is the mass matrix and what is added to its diagonal. What acts on one body by a law G adds to the inertia and the bias of
that body, what acts on a joint to its D, RBDA 7.43-7.45: the recursion is that of forward dynamics, for velocities and
impulses, or for accelerations and forces. Subtrees in which nothing of the kind acts stay the same, and are folded once.

Loops tie bodies of different branches: they add rows K v = c, and a pull λ along each,

    (A + …) v = p − … + Kᵀ λ,      Λ λ = c − K v₀,      Λ = K (A + …)⁻¹ Kᵀ,      v₀ = v without λ.

Their columns are folded with the tree, each along its own way to the root and no farther. Λ and K v₀ are sums of products of
what coordinates leave of them, Σ w D⁻¹ w and Σ w D⁻¹ u: the tree need not be unfolded for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import combinations_with_replacement

from articulated.dynamics.elimination import Closed, Elimination, Row, merged
from articulated.dynamics.kinematics import combination
from articulated.dynamics.loops.closure import Line
from articulated.dynamics.loops.factor import Factor, Redundancy
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, given, maximum, unfolded
from articulated.spatial import ArticulatedInertia, Force, Mat3, Motion, Sym3, Vec3

_SOFT = 1e-15
"""A row that gives way acts as if it had this mass at least [kg]: what does not act at all cannot be told from it."""


@dataclass(eq=False)
class Load:
    """With what terms add: inertia and bias of bodies; to momenta and masses of coordinates, and between those of a joint."""

    IA: list[ArticulatedInertia]
    pA: list[Force]
    p: dict[int, Scalar]
    mass: dict[int, Scalar]
    between: dict[tuple[int, int], Scalar]
    lines: dict[int, tuple[Scalar, Scalar]]

    def on_body(self, i: int, acts: Scalar, inertia: ArticulatedInertia, bias: Force) -> None:
        """Add something that is nothing unless the mask `acts` holds."""
        new = given(acts, lambda: [*self.IA[i] + inertia, *self.pA[i] + bias], [*self.IA[i], *self.pA[i]])
        self.IA[i], self.pA[i] = ArticulatedInertia.of(new[:21]), Force.of(new[21:])

    def on_joint(self, direction: dict[int, Scalar], mass: Scalar, p: Scalar) -> None:
        for s, x in direction.items():
            self.p[s] = self.p.get(s, 0.0) + p * x
            self.mass[s] = self.mass.get(s, 0.0) + mass * x * x
            for t, y in direction.items():
                if t > s:
                    self.between[s, t] = self.between.get((s, t), 0.0) + mass * x * y

    def on_line(self, k: int, mass: Scalar, p: Scalar) -> None:
        """Let row k give way: not K v = c, but λ = p − mass K v."""
        self.lines[k] = mass, p


class Sweep:
    """The system at one configuration, for any load.

    Attributes:
        moving: the coordinates that change with the load.
        lines: rows of loops.
    """

    def __init__(
        self,
        tree: Tree,
        p: Sequence[Scalar],
        mass: Sequence[Scalar],
        bodies: Iterable[int] = (),
        coordinates: Iterable[int] = (),
        lines: Sequence[Line] = (),
        sizes: Sequence[int] = (),
        known: Redundancy | None = None,
        leaves_out: bool = True,
    ):
        """Take the tree, the right side, what is added to D, and where terms act: on which bodies and coordinates.

        And rows of loops, so many of each; for `known` and `leaves_out` see `Factor`.
        """
        m = self.mechanism = tree.mechanism
        self.tree, self.p, self.mass, self.lines = tree, p, mass, lines
        acted, coordinates = set(bodies), set(coordinates)
        acted |= {i for i, joint in enumerate(m.joints) if coordinates & set(joint.v)}
        self.active = {k for i in acted for k in (WORLD, *m.support(i))}
        self.moving = sorted(s for i in self.active for s in m.closes[i])
        self._factored = partial(Factor, sizes=sizes, known=known, leaves_out=leaves_out)
        self._quiet = _Folded.begin(tree, p, lines)
        still = [i for i in reversed(range(m.nbodies)) if i not in self.active]
        self._fold(self._quiet, still, self.unloaded())
        if not self.active:
            self._close_world(self._quiet)
        self._quiet.sum_up(still if self.active else [*still, WORLD])

    def unloaded(self) -> Load:
        """Without any term."""
        return Load(list(self._quiet.IA), list(self._quiet.pA), {}, {}, {}, {})

    def solve(self, load: Load, target: Sequence[Scalar] = ()) -> tuple[list[Scalar], list[Motion], list[Scalar]]:
        """For the coordinates that move with the load their velocities, and the bodies'; 0 for others. And loops' pulls.

        `target` is c, of each row.
        """
        folded = self._folded(load)
        pulls = self._factor(folded).solve(folded.change(target, load.lines))
        v: list[Scalar] = [0.0] * self.mechanism.nv
        bodies = sorted(self.active - {WORLD})
        V = self._unfold(folded, v, solves=lambda i: i in self.active, bodies=bodies, u=_with(pulls))
        return v, V, pulls

    def rest(self, moving: Sequence[Scalar], pulls: Sequence[Scalar] = ()) -> list[Scalar]:
        """The velocities of all coordinates, from those that move with the load and the pulls."""
        v: list[Scalar] = [0.0] * self.mechanism.nv
        for s, x in zip(self.moving, moving, strict=True):
            v[s] = x
        bodies = range(self.mechanism.nbodies)
        self._unfold(self._quiet, v, solves=lambda i: i not in self.active, bodies=bodies, u=_with(pulls))
        return v

    def corrected(self, change: Sequence[Scalar], corrections: int = 0) -> list[Scalar]:
        """The least change of velocities, by A, that gives rows this change, whatever acts.

        `corrections` refine it as they do `solve`; what changes a little at a time needs none.
        """
        pulls = self._factor(self._alone).solve(change, corrections)
        v: list[Scalar] = [0.0] * self.mechanism.nv
        bodies = range(self.mechanism.nbodies)
        self._unfold(self._alone, v, solves=lambda i: True, bodies=bodies, u=lambda closed: closed.pulled(pulls))
        return v

    @property
    def redundancy(self) -> Redundancy:
        """Of the rows of loops."""
        return self._factor(self._alone).redundancy

    def _factor(self, folded: _Folded) -> Factor:
        """Of Λ."""
        if folded.factor is None:
            folded.factor = self._factored(folded.matrix, soft=folded.soft)
        return folded.factor

    @cached_property
    def _alone(self) -> _Folded:
        return self._folded(self.unloaded()) if self.active else self._quiet

    def _folded(self, load: Load) -> _Folded:
        """All of the tree, with a load."""
        if not self.active:
            return self._quiet
        folded = self._quiet.copy(load)
        bodies = sorted(self.active - {WORLD}, reverse=True)
        self._fold(folded, bodies, load)
        self._close_world(folded)
        folded.sum_up([*bodies, WORLD])
        folded.soft = {k: 1.0 / maximum(mass, _SOFT) for k, (mass, _) in load.lines.items()}
        return folded

    def _fold(self, folded: _Folded, bodies: Iterable[int], load: Load) -> None:
        """Inward: fold each subtree into its parent, its joint free."""
        m, tree = self.mechanism, self.tree
        for i in bodies:
            joint = m.joints[i]
            e = folded.eliminations[i] = Elimination.begin(merged(folded.open[i]), folded.IA[i], folded.pA[i], folded.K[i])
            p = {s: self.p[s] + load.p[s] if s in load.p else self.p[s] for s in joint.v}
            mass = {s: self.mass[s] + load.mass[s] if s in load.mass else self.mass[s] for s in joint.v}
            e.open_joint(tree.S[i], joint.v, p, mass, follows=joint.follows)
            if not joint.follows:
                for (s, t), x in load.between.items():
                    if s in joint.v:
                        e.couple(s, t, x)
                for k, line in enumerate(self.lines):
                    for s in line.turns.keys() & set(joint.v):
                        e.pull(s, k, line.turns[s])
            e.close(m.closes[i])
            if (parent := m.parent[i]) != WORLD:
                folded.IA[parent] = folded.IA[parent] + e.IA
                folded.pA[parent] = folded.pA[parent] + e.pA
                for k, K in e.K.items():
                    folded.pull(parent, k, K)
            folded.open[parent].append(e.rows)

    def _close_world(self, folded: _Folded) -> None:
        world = folded.eliminations[WORLD] = Elimination.begin(merged(folded.open[WORLD]))
        world.close(self.mechanism.closes[WORLD])

    def _unfold(
        self,
        folded: _Folded,
        v: list[Scalar],
        solves: Callable[[int], bool],
        bodies: Iterable[int],
        u: Callable[[Closed], Scalar],
    ) -> list[Motion]:
        """Outward: velocities, filled into v, for these right sides."""
        m, V = self.mechanism, [Motion.zero()] * self.mechanism.nbodies
        if solves(WORLD):
            folded.eliminations[WORLD].solve(Motion.zero(), v, u)
        for i in bodies:
            p = m.parent[i]
            carried = Motion.zero() if p == WORLD else V[p]
            if solves(i):
                folded.eliminations[i].solve(carried, v, u)
            own = combination(self.tree.S[i], [v[s] for s in m.joints[i].v])
            V[i] = own if p == WORLD else carried + own
        return V


def _with(pulls: Sequence[Scalar]) -> Callable[[Closed], Scalar]:
    """The right side with pulls."""
    return lambda closed: closed.u + closed.pulled(pulls) if closed.w else closed.u


@dataclass(eq=False)
class _Folded:
    """How far a tree has been folded.

    Attributes:
        IA, pA, K: what each body shows by then.
        open: the rows left open below it.
        eliminations: of bodies that have been folded.
        matrix, free: Λ and K v₀ by then.
        soft: of rows that give way, how much they do.
        factor: of Λ, once it is wanted.
    """

    IA: list[ArticulatedInertia]
    pA: list[Force]
    K: list[dict[int, Force]]
    open: dict[int, list[dict[int, Row]]]
    eliminations: dict[int, Elimination]
    matrix: dict[tuple[int, int], Scalar]
    free: list[Scalar]
    soft: dict[int, Scalar] = field(default_factory=dict)
    factor: Factor | None = None

    @staticmethod
    def begin(tree: Tree, p: Sequence[Scalar], lines: Sequence[Line]) -> _Folded:
        n = tree.mechanism.nbodies

        def plain(entries: Iterable[Scalar]) -> Iterator[Scalar]:
            # bits are the same if a load might act but does not
            return (unfolded(x, p) for x in entries)

        def loadable(inertia: ArticulatedInertia) -> ArticulatedInertia:
            H = Mat3(*(Vec3(*plain(row)) for row in inertia.H.rows))
            return ArticulatedInertia(Sym3(*plain(inertia.J)), H, Sym3(*plain(inertia.M)))

        nothing = Vec3(*plain((0.0, 0.0, 0.0)))
        IA = [loadable(tree.inertia(i).articulated()) for i in range(n)]
        K: list[dict[int, Force]] = [{} for _ in range(n)]
        start = _Folded(IA, [Force(nothing, nothing)] * n, K, {i: [] for i in range(WORLD, n)}, {}, {}, [0.0] * len(lines))
        for k, line in enumerate(lines):
            if line.K is not None:
                for body, sign in ((line.a, -1.0), (line.b, 1.0)):
                    if body != WORLD:
                        start.pull(body, k, line.K * sign)
        return start

    def pull(self, body: int, k: int, K: Force) -> None:
        """Add to what a unit of pull k is on a body."""
        mine = self.K[body]
        mine[k] = mine[k] + K if k in mine else K

    def copy(self, load: Load) -> _Folded:
        """Another, with a load."""
        open_ = {i: [{s: row.copy() for s, row in rows.items()} for rows in parts] for i, parts in self.open.items()}
        K = [dict(some) for some in self.K]
        return _Folded(list(load.IA), list(load.pA), K, open_, dict(self.eliminations), dict(self.matrix), list(self.free))

    def sum_up(self, bodies: Iterable[int]) -> None:
        """Count in what the coordinates given up at these bodies leave of the loops' rows."""
        for i in bodies:
            for closed in self.eliminations[i].closed:
                weighted = {k: w * closed.Dinv for k, w in closed.w.items()}
                for j, k in combinations_with_replacement(sorted(weighted), 2):
                    self.matrix[j, k] = self.matrix.get((j, k), 0.0) + closed.w[j] * weighted[k]
                for k, x in weighted.items():
                    self.free[k] = self.free[k] + x * closed.u

    def change(self, target: Sequence[Scalar], given: Mapping[int, tuple[Scalar, Scalar]]) -> list[Scalar]:
        """What pulls must add to the rows' velocities; where these give way, as if they did not."""
        wanted = [*target, *[0.0] * (len(self.free) - len(target))]
        for k, (_, p) in given.items():
            wanted[k] = p * self.soft[k]
        return [c - x for c, x in zip(wanted, self.free, strict=True)]
