"""The linear system (A + Jᵀ G J) v = p − Jᵀ (g − G u), by the articulated-body algorithm: O(n).

A is the mass matrix and what is added to its diagonal. What acts on one body by a law G adds to the inertia and the bias of
that body, what acts on a joint to its D, RBDA 7.43-7.45: the recursion is that of forward dynamics, for velocities and
impulses, or for accelerations and forces. Subtrees in which nothing of the kind acts stay the same, and are folded once.

Loops tie bodies of different branches: they add rows K v = c, and a pull λ along each,

    (A + …) v = p − … + Kᵀ λ,      Λ λ = c − K v₀,      Λ = K (A + …)⁻¹ Kᵀ,      v₀ = v without λ.

Each column goes through the folded tree by itself, along its own way to the root and no farther: w = Sᵀ K, and K − U D⁻¹ w is
left of it for the parent. Λ and K v₀ are Σ w D⁻¹ w and Σ w D⁻¹ u: the tree need not be unfolded for them.

What acts by a law between two bodies, such as a contact, leaves the tree: see `together`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from articulated.dynamics.elimination import Closed, Elimination, merged
from articulated.dynamics.folded import Cross, Folded, Load
from articulated.dynamics.kinematics import combination
from articulated.dynamics.loops.closure import Line
from articulated.dynamics.loops.factor import CORRECTIONS, Factor, Redundancy
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.together import Together
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, maximum
from articulated.spatial import ArticulatedInertia, Force, Motion

_SOFT = 1e-15
"""A row that gives way acts as if it had this mass at least [kg]: what does not act at all cannot be told from it."""


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
_NONE: Mapping[Any, Any] = {}


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
        pairs: Iterable[tuple[int, int]] = (),
        inertia: Mapping[int, ArticulatedInertia] = _NONE,
        cross: Mapping[tuple[int, int], Sequence[Cross]] = _NONE,
    ):
        """Take the tree, the right side, what is added to D, and where terms act.

        That is: on which bodies and coordinates, on rows of which loops, and between which bodies. `inertia` and `cross` are
        what bodies have besides their own, whatever the load.
        """
        m = self.mechanism = tree.mechanism
        self.tree, self.p, self.mass, self.lines, self._ties = tree, p, mass, ties.lines, ties
        self._together = Together(tree, pairs, cross)
        acted, coordinates = {*bodies, *self._together.bodies}, set(coordinates)
        acted |= {i for i, joint in enumerate(m.joints) if coordinates & set(joint.v)}
        self.active = {k for i in acted for k in (WORLD, *m.support(i))}
        self.moving = sorted(s for i in self.active for s in m.closes[i])
        self._quiet = Folded.begin(tree, p, ties.lines)
        for i, more in inertia.items():
            self._quiet.IA[i] = self._quiet.IA[i] + more
        still = [i for i in reversed(range(m.nbodies)) if i not in self.active]
        self._fold(self._quiet, still, self.unloaded())
        if not self.active:
            self._close_world(self._quiet)
        self._carry(self._quiet, still if self.active else [*still, WORLD])
        if not self.active:
            self._quiet.factor = self._factor(self._quiet)

    def holds_pairs(self, pairs: Iterable[tuple[int, int]]) -> bool:
        """Whether loads may act between all of these bodies."""
        return set(pairs) <= set(self._together.pairs)

    def unloaded(self) -> Load:
        """Without any term."""
        return Load(list(self._quiet.IA), list(self._quiet.pA), {}, {}, {}, {})

    def solve(
        self, load: Load, target: Sequence[Scalar] = (), corrections: int = CORRECTIONS
    ) -> tuple[list[Scalar], list[Motion], list[Scalar]]:
        """For the coordinates that move with the load their velocities, and the bodies'; 0 for others. And loops' pulls.

        `target` is c, of each row; `corrections` as of `Factor.solve`.
        """
        return self.solved(self.folded(load), load, target, corrections)

    def solved(
        self, folded: Folded, load: Load, target: Sequence[Scalar] = (), corrections: int = CORRECTIONS
    ) -> tuple[list[Scalar], list[Motion], list[Scalar]]:
        """As `solve`, of what has been folded with that load."""
        pulls = self._factor_of(folded).solve(folded.change(target, load.lines), corrections)
        return *self._unfolded(folded, folded.with_pulls(pulls)), pulls

    def again(self, folded: Folded, p: Sequence[Scalar]) -> tuple[list[Scalar], list[Motion], list[Scalar]]:
        """As `solved`, for another right side, of the coordinates that move with the load; loops' rows do not move.

        Only the right sides are carried through what has been folded.
        """
        m, right = self.mechanism, dict(zip(self.moving, p, strict=True))
        pA: dict[int, Force] = {}
        u: dict[int, Scalar] = {}
        free: list[Scalar] = [0.0] * len(self.lines)
        for i in [*sorted(self.active - {WORLD}, reverse=True), WORLD]:
            bias = pA.get(i, Force.zero())
            if i != WORLD:
                for column, s in zip(self.tree.S[i], m.joints[i].v, strict=True):
                    own = right[s] if s in right and not m.joints[i].follows else 0.0
                    u[s] = u.get(s, 0.0) + own - column.dot(bias)
            for closed in folded.eliminations[i].closed:
                scaled = u[closed.s] * closed.Dinv
                for k, w in folded.w.get(closed.s, {}).items():
                    free[k] = free[k] + w * scaled
                bias = bias + closed.U * scaled
                for t, d in closed.D.items():
                    u[t] = u.get(t, 0.0) - d * scaled
            if i != WORLD and (parent := m.parent[i]) != WORLD:
                pA[parent] = pA[parent] + bias if parent in pA else bias
        pulls = self._factor_of(folded).solve([-x for x in free], 0)
        return *self._unfolded(folded, lambda closed: u[closed.s] + folded.pulled(closed, pulls)), pulls

    def _unfolded(self, folded: Folded, u: Callable[[Closed], Scalar]) -> tuple[list[Scalar], list[Motion]]:
        v: list[Scalar] = [0.0] * self.mechanism.nv
        bodies = sorted(self.active - {WORLD})
        return v, self._unfold(folded, v, solves=lambda i: i in self.active, bodies=bodies, u=u)

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

    def _factor(self, folded: Folded) -> Factor:
        """Of Λ; ropes give way."""
        n = len(self.lines)
        soft = dict.fromkeys(range(n - self._ties.ropes, n), 1.0 / _SOFT) | folded.soft
        return Factor(folded.matrix, self._ties.sizes, soft, self._ties.known, self._ties.leaves_out)

    def _factor_of(self, folded: Folded) -> Factor:
        if folded.factor is None:
            folded.factor = self._factor(folded)
        return folded.factor

    def folded(self, load: Load) -> Folded:
        """All of the tree, with a load."""
        if not self.active:
            return self._quiet
        folded = self._quiet.copy(load)
        bodies = sorted(self.active - {WORLD}, reverse=True)
        self._fold(folded, [i for i in bodies if i not in self._together.bodies], load)
        if self._together.bodies:
            folded.eliminations |= {i: Elimination.none() for i in self._together.bodies}
            folded.eliminations[WORLD] = self._together.elimination(folded, load, self.p, self.mass)
        else:
            self._close_world(folded)
        self._carry(folded, [*bodies, WORLD])
        folded.soft = {k: 1.0 / maximum(mass, _SOFT) for k, (mass, _) in load.lines.items()}
        return folded

    def _fold(self, folded: Folded, bodies: Iterable[int], load: Load) -> None:
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

    def _carry(self, folded: Folded, bodies: Sequence[int]) -> None:
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

    def _close_world(self, folded: Folded) -> None:
        world = folded.eliminations[WORLD] = Elimination.begin(merged(folded.open[WORLD]))
        world.close(self.mechanism.closes[WORLD])

    def _unfold(
        self,
        folded: Folded,
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
