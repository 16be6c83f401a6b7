"""The linear system (A + Jᵀ G J) v = p − Jᵀ (g − G u), by the articulated-body algorithm: O(n).

A is the mass matrix and what is added to its diagonal. What acts on one body by a law G adds to the inertia and the bias of
that body, what acts on a joint to its D, RBDA 7.43-7.45: the recursion is that of forward dynamics, for velocities and
impulses, or for accelerations and forces. Subtrees in which nothing of the kind acts stay the same, and are folded once.

Loops tie bodies of different branches: they add rows K v = c, and a pull λ along each,

    (A + …) v = p − … + Kᵀ λ,      Λ λ = c − K v₀,      Λ = K (A + …)⁻¹ Kᵀ,      v₀ = v without λ.

Each column goes through the folded tree by itself, along its own way to the root and no farther: w = Sᵀ K, and K − U D⁻¹ w is
left of it for the parent. Λ and K v₀ are Σ w D⁻¹ w and Σ w D⁻¹ u: the tree need not be unfolded for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from articulated.dynamics.elimination import Closed, Elimination, Row, merged
from articulated.dynamics.kinematics import combination
from articulated.dynamics.loops.closure import Line
from articulated.dynamics.loops.factor import CORRECTIONS, Factor, Redundancy
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


@dataclass(frozen=True, eq=False)
class Ties:
    """What joins bodies besides joints.

    Attributes:
        lines: rows of loops.
        sizes: how many each loop has.
        ropes: how many of the last loops are ropes, of one row each, which give way unless a load says otherwise.
        known, leaves_out: see `Factor`.
    """

    lines: Sequence[Line] = ()
    sizes: Sequence[int] = ()
    ropes: int = 0
    known: Redundancy | None = None
    leaves_out: bool = True


_UNTIED = Ties()


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
        ties: Ties = _UNTIED,
    ):
        """Take the tree, the right side, what is added to D, where terms act (on which bodies and coordinates), and loops."""
        m = self.mechanism = tree.mechanism
        self.tree, self.p, self.mass, self.lines, self._ties = tree, p, mass, ties.lines, ties
        acted, coordinates = set(bodies), set(coordinates)
        acted |= {i for i, joint in enumerate(m.joints) if coordinates & set(joint.v)}
        self.active = {k for i in acted for k in (WORLD, *m.support(i))}
        self.moving = sorted(s for i in self.active for s in m.closes[i])
        self._quiet = _Folded.begin(tree, p, ties.lines)
        still = [i for i in reversed(range(m.nbodies)) if i not in self.active]
        self._fold(self._quiet, still, self.unloaded())
        if not self.active:
            self._close_world(self._quiet)
        self._carry(self._quiet, still if self.active else [*still, WORLD])
        if not self.active:
            self._quiet.factor = self._factor(self._quiet)

    def unloaded(self) -> Load:
        """Without any term."""
        return Load(list(self._quiet.IA), list(self._quiet.pA), {}, {}, {}, {})

    def solve(
        self, load: Load, target: Sequence[Scalar] = (), corrections: int = CORRECTIONS
    ) -> tuple[list[Scalar], list[Motion], list[Scalar]]:
        """For the coordinates that move with the load their velocities, and the bodies'; 0 for others. And loops' pulls.

        `target` is c, of each row; `corrections` as of `Factor.solve`.
        """
        folded = self._folded(load)
        pulls = (folded.factor or self._factor(folded)).solve(folded.change(target, load.lines), corrections)
        v: list[Scalar] = [0.0] * self.mechanism.nv
        bodies = sorted(self.active - {WORLD})
        V = self._unfold(folded, v, solves=lambda i: i in self.active, bodies=bodies, u=folded.with_pulls(pulls))
        return v, V, pulls

    def rest(self, moving: Sequence[Scalar], pulls: Sequence[Scalar] = ()) -> list[Scalar]:
        """The velocities of all coordinates, from those that move with the load and the pulls."""
        v: list[Scalar] = [0.0] * self.mechanism.nv
        for s, x in zip(self.moving, moving, strict=True):
            v[s] = x
        bodies = range(self.mechanism.nbodies)
        self._unfold(self._quiet, v, solves=lambda i: i not in self.active, bodies=bodies, u=self._quiet.with_pulls(pulls))
        return v

    def corrected(self, change: Sequence[Scalar], corrections: int = 0) -> list[Scalar]:
        """The least change of velocities, by A, that gives rows this change, if nothing acts by a law.

        `corrections` refine it as they do `solve`; what changes a little at a time needs none.
        """
        pulls = self._alone.solve(change, corrections)
        v: list[Scalar] = [0.0] * self.mechanism.nv
        bodies = range(self.mechanism.nbodies)
        self._unfold(self._quiet, v, solves=lambda i: True, bodies=bodies, u=lambda closed: self._quiet.pulled(closed, pulls))
        return v

    @property
    def redundancy(self) -> Redundancy:
        """How rows of loops repeat each other, if nothing acts by a law."""
        return self._alone.redundancy

    @property
    def _alone(self) -> Factor:
        assert self._quiet.factor is not None
        return self._quiet.factor

    def _factor(self, folded: _Folded) -> Factor:
        """Of Λ; ropes give way."""
        n = len(self.lines)
        soft = dict.fromkeys(range(n - self._ties.ropes, n), 1.0 / _SOFT) | folded.soft
        return Factor(folded.matrix, self._ties.sizes, soft, self._ties.known, self._ties.leaves_out)

    def _folded(self, load: Load) -> _Folded:
        """All of the tree, with a load."""
        if not self.active:
            return self._quiet
        folded = self._quiet.copy(load)
        bodies = sorted(self.active - {WORLD}, reverse=True)
        self._fold(folded, bodies, load)
        self._close_world(folded)
        self._carry(folded, [*bodies, WORLD])
        folded.soft = {k: 1.0 / maximum(mass, _SOFT) for k, (mass, _) in load.lines.items()}
        return folded

    def _fold(self, folded: _Folded, bodies: Iterable[int], load: Load) -> None:
        """Inward: fold each subtree into its parent, its joint free."""
        m, tree = self.mechanism, self.tree
        for i in bodies:
            joint = m.joints[i]
            e = folded.eliminations[i] = Elimination.begin(merged(folded.open[i]), folded.IA[i], folded.pA[i])
            p = {s: self.p[s] + load.p[s] if s in load.p else self.p[s] for s in joint.v}
            mass = {s: self.mass[s] + load.mass[s] if s in load.mass else self.mass[s] for s in joint.v}
            e.open_joint(tree.S[i], joint.v, p, mass, follows=joint.follows)
            for (s, t), x in load.between.items():
                if s in joint.v and not joint.follows:
                    e.couple(s, t, x)
            e.close(m.closes[i])
            if (parent := m.parent[i]) != WORLD:
                folded.IA[parent] = folded.IA[parent] + e.IA
                folded.pA[parent] = folded.pA[parent] + e.pA
            folded.open[parent].append(e.rows)

    def _carry(self, folded: _Folded, bodies: Sequence[int]) -> None:
        """Take the columns of loops through bodies that have been folded, each from its end on; what is left is Λ and K v₀."""
        m = self.mechanism
        for k, line in enumerate(self.lines):
            for i in bodies:
                K = folded.K[k].pop(i, None)
                own = m.joints[i].v if i != WORLD else ()
                if K is not None:
                    for column, s in zip(self.tree.S[i], own, strict=True):
                        folded.left[k][s] = folded.left[k].get(s, 0.0) + column.dot(K)
                for s in own:
                    if s in line.turns and not m.joints[i].follows:
                        folded.left[k][s] = folded.left[k].get(s, 0.0) + line.turns[s]
                for closed in folded.eliminations[i].closed:
                    if (w := folded.left[k].pop(closed.s, None)) is not None:
                        scaled = folded.close(k, closed, w)
                        K = closed.U * -scaled if K is None else K - closed.U * scaled
                if K is not None and i != WORLD and m.parent[i] != WORLD:
                    folded.pull(m.parent[i], k, K)

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


@dataclass(eq=False)
class _Folded:
    """How far a tree has been folded.

    Attributes:
        IA, pA: what each body shows by then.
        K: of each row of loops, what a unit of its pull is on bodies that have not been folded.
        open: the rows left open below it.
        eliminations: of bodies that have been folded.
        left: of each row, what is left of it for coordinates still open.
        w: and for coordinates given up.
        matrix, free: Λ and K v₀ by then.
        soft: of rows that give way, how much they do.
        factor: of Λ, if it is there already.
    """

    IA: list[ArticulatedInertia]
    pA: list[Force]
    K: list[dict[int, Force]]
    open: dict[int, list[dict[int, Row]]]
    eliminations: dict[int, Elimination]
    left: list[dict[int, Scalar]]
    w: dict[int, dict[int, Scalar]]
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
        IA, m = [loadable(tree.inertia(i).articulated()) for i in range(n)], len(lines)
        start = _Folded(
            IA,
            [Force(nothing, nothing)] * n,
            [{} for _ in range(m)],
            {i: [] for i in range(WORLD, n)},
            {},
            [{} for _ in range(m)],
            {},
            {},
            [0.0] * m,
        )
        for k, line in enumerate(lines):
            if line.K is not None:
                for body, sign in ((line.a, -1.0), (line.b, 1.0)):
                    if body != WORLD:
                        start.pull(body, k, line.K * sign)
        return start

    def pull(self, body: int, k: int, K: Force) -> None:
        """Add to what a unit of pull k is on a body."""
        self.K[k][body] = self.K[k][body] + K if body in self.K[k] else K

    def copy(self, load: Load) -> _Folded:
        """Another, with a load."""
        return replace(
            self,
            IA=list(load.IA),
            pA=list(load.pA),
            K=[dict(some) for some in self.K],
            open={
                i: [{s: Row(row.U, dict(row.D), row.u) for s, row in rows.items()} for rows in parts]
                for i, parts in self.open.items()
            },
            eliminations=dict(self.eliminations),
            left=[dict(some) for some in self.left],
            w={s: dict(some) for s, some in self.w.items()},
            matrix=dict(self.matrix),
            free=list(self.free),
        )

    def close(self, k: int, closed: Closed, w: Scalar) -> Scalar:
        """Count in what is left of row k for a coordinate that has been given up; D⁻¹ w is returned."""
        scaled = w * closed.Dinv
        for t, d in closed.D.items():
            self.left[k][t] = self.left[k].get(t, 0.0) - d * scaled
        others = self.w.setdefault(closed.s, {})
        others[k] = w
        for j, x in others.items():
            self.matrix[j, k] = self.matrix.get((j, k), 0.0) + x * scaled
        self.free[k] = self.free[k] + scaled * closed.u
        return scaled

    def pulled(self, closed: Closed, pulls: Sequence[Scalar]) -> Scalar:
        """What pulls of these sizes add to u."""
        return sum((pulls[k] * w for k, w in self.w.get(closed.s, {}).items()), 0.0)

    def with_pulls(self, pulls: Sequence[Scalar]) -> Callable[[Closed], Scalar]:
        """The right sides with pulls."""
        return lambda closed: closed.u + self.pulled(closed, pulls) if closed.s in self.w else closed.u

    def change(self, target: Sequence[Scalar], given: Mapping[int, tuple[Scalar, Scalar]]) -> list[Scalar]:
        """What pulls must add to the rows' velocities; where these give way, as if they did not."""
        wanted = [*target, *[0.0] * (len(self.free) - len(target))]
        for k, (_, p) in given.items():
            wanted[k] = p * self.soft[k]
        return [c - x for c, x in zip(wanted, self.free, strict=True)]
