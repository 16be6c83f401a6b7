"""The linear system of a Newton step, (A + Jᵀ G J) v = p − Jᵀ (g − G u), by the articulated-body algorithm: O(n).

A contact adds to the inertia and the bias of its body, a joint's term to the D of its joint, RBDA 7.43-7.45: the recursion is
that of forward dynamics, for velocities and impulses. Subtrees in which no term acts stay the same, and are folded once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from articulated.dynamics.elimination import Elimination, Row, merged
from articulated.dynamics.kinematics import combination
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, given, unfolded
from articulated.spatial import ArticulatedInertia, Force, Mat3, Motion, Sym3, Vec3


@dataclass(eq=False)
class Load:
    """With what terms add: inertia and bias of bodies; to momenta and masses of coordinates, and between those of a joint."""

    IA: list[ArticulatedInertia]
    pA: list[Force]
    p: dict[int, Scalar]
    mass: dict[int, Scalar]
    between: dict[tuple[int, int], Scalar]

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


class Sweep:
    """The system of one step, for any load.

    Attributes:
        moving: the coordinates that change with the load.
    """

    def __init__(
        self, tree: Tree, p: Sequence[Scalar], mass: Sequence[Scalar], bodies: Iterable[int], coordinates: Iterable[int]
    ):
        """Take the tree, the right side, what is added to D, and where terms act: on which bodies and coordinates."""
        m = self.mechanism = tree.mechanism
        self.tree, self.p, self.mass = tree, p, mass
        acted, coordinates = set(bodies), set(coordinates)
        acted |= {i for i, joint in enumerate(m.joints) if coordinates & set(joint.v)}
        self.active = {k for i in acted for k in (WORLD, *m.support(i))}
        self.moving = sorted(s for i in self.active for s in m.closes[i])
        self._quiet = _Folded.begin(tree, p)
        self._fold(self._quiet, (i for i in reversed(range(m.nbodies)) if i not in self.active), self.unloaded())
        if not self.active:
            self._close_world(self._quiet)

    def unloaded(self) -> Load:
        """Without any term."""
        return Load(list(self._quiet.IA), list(self._quiet.pA), {}, {}, {})

    def solve(self, load: Load) -> tuple[list[Scalar], list[Motion]]:
        """The velocities of the coordinates that move with the load, and of the bodies that do; 0 for the others."""
        folded = self._quiet.copy(load)
        self._fold(folded, sorted(self.active - {WORLD}, reverse=True), load)
        self._close_world(folded)
        v: list[Scalar] = [0.0] * self.mechanism.nv
        return v, self._unfold(folded, v, solves=lambda i: i in self.active, bodies=sorted(self.active - {WORLD}))

    def rest(self, moving: Sequence[Scalar]) -> list[Scalar]:
        """The velocities of all coordinates, from those that move with the load."""
        v: list[Scalar] = [0.0] * self.mechanism.nv
        for s, x in zip(self.moving, moving, strict=True):
            v[s] = x
        bodies = range(self.mechanism.nbodies)
        self._unfold(self._quiet, v, solves=lambda i: i not in self.active, bodies=bodies)
        return v

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

    def _close_world(self, folded: _Folded) -> None:
        world = folded.eliminations[WORLD] = Elimination.begin(merged(folded.open[WORLD]))
        world.close(self.mechanism.closes[WORLD])

    def _unfold(self, folded: _Folded, v: list[Scalar], solves: Callable[[int], bool], bodies: Iterable[int]) -> list[Motion]:
        """Outward: velocities, filled into v."""
        m, V = self.mechanism, [Motion.zero()] * self.mechanism.nbodies
        if solves(WORLD):
            folded.eliminations[WORLD].solve(Motion.zero(), v)
        for i in bodies:
            p = m.parent[i]
            carried = Motion.zero() if p == WORLD else V[p]
            if solves(i):
                folded.eliminations[i].solve(carried, v)
            own = combination(self.tree.S[i], [v[s] for s in m.joints[i].v])
            V[i] = own if p == WORLD else carried + own
        return V


@dataclass(eq=False)
class _Folded:
    """How far a tree has been folded: what each body shows by then, and the rows left open below it."""

    IA: list[ArticulatedInertia]
    pA: list[Force]
    open: dict[int, list[dict[int, Row]]]
    eliminations: dict[int, Elimination]

    @staticmethod
    def begin(tree: Tree, p: Sequence[Scalar]) -> _Folded:
        n = tree.mechanism.nbodies

        def plain(entries: Iterable[Scalar]) -> Iterator[Scalar]:
            # bits are the same if a load might act but does not
            return (unfolded(x, p) for x in entries)

        def loadable(inertia: ArticulatedInertia) -> ArticulatedInertia:
            H = Mat3(*(Vec3(*plain(row)) for row in inertia.H.rows))
            return ArticulatedInertia(Sym3(*plain(inertia.J)), H, Sym3(*plain(inertia.M)))

        nothing = Vec3(*plain((0.0, 0.0, 0.0)))
        IA = [loadable(tree.inertia(i).articulated()) for i in range(n)]
        return _Folded(IA, [Force(nothing, nothing)] * n, {i: [] for i in range(WORLD, n)}, {})

    def copy(self, load: Load) -> _Folded:
        """Another, with a load."""
        open_ = {
            i: [{s: Row(row.U, dict(row.D), row.u) for s, row in rows.items()} for rows in parts]
            for i, parts in self.open.items()
        }
        return _Folded(list(load.IA), list(load.pA), open_, dict(self.eliminations))
