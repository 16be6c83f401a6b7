"""What the sweep carries: what a load adds to bodies and joints, and how far a tree has been folded. See `sweep`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from articulated.dynamics.elimination import Closed, Elimination, Row
from articulated.dynamics.loops.closure import Line
from articulated.dynamics.loops.factor import Factor
from articulated.dynamics.mechanism import WORLD
from articulated.dynamics.tree import Tree
from articulated.scalar import UNDEFINED, Scalar, either, given, unfolded, where
from articulated.spatial import ArticulatedInertia, Force, Mat3, Motion, Sym3, Vec3


@dataclass(frozen=True, eq=False)
class Pull:
    """Between two bodies: whether anything acts, and with what inertia and bias, not defined if nothing does."""

    acts: Scalar
    IA: ArticulatedInertia
    pA: Force


@dataclass(frozen=True, eq=False)
class Cross:
    """[[J, H], [L, M]]: the momentum that body i shows for velocities of body j, about O."""

    J: Mat3
    H: Mat3
    L: Mat3
    M: Mat3

    @staticmethod
    def of(rows: Sequence[Sequence[Scalar]]) -> Cross:
        """From six rows of six."""
        parts = (Mat3.of([row[k : k + 3] for row in some]) for some in (rows[:3], rows[3:]) for k in (0, 3))
        return Cross(*parts)

    def about(self, point: Vec3) -> Cross:
        """The same about O of one that is about a point: Xᵀ S X, with X = [[1, 0], [−p×, 1]]."""
        K = Mat3.skew(point)
        J, L = self.J - self.H @ K, self.L - self.M @ K
        return Cross(J + K @ L, self.H + K @ self.M, L, self.M)

    def __matmul__(self, v: Motion) -> Force:
        return Force(self.J @ v.angular + self.H @ v.linear, self.L @ v.angular + self.M @ v.linear)

    def transpose_times(self, v: Motion) -> Force:
        """Of body j for velocities of body i."""
        return Force(
            self.J.transpose_times(v.angular) + self.L.transpose_times(v.linear),
            self.H.transpose_times(v.angular) + self.M.transpose_times(v.linear),
        )


@dataclass(eq=False)
class Load:
    """What terms add: inertia and bias of bodies; momenta and masses of coordinates, and between those of a joint.

    And of rows of loops that give way, and of what acts between two bodies: to the velocity of the first in the second.
    """

    IA: list[ArticulatedInertia]
    pA: list[Force]
    p: dict[int, Scalar]
    mass: dict[int, Scalar]
    between: dict[tuple[int, int], Scalar]
    lines: dict[int, tuple[Scalar, Scalar]]
    pairs: dict[tuple[int, int], Pull] = field(default_factory=dict)

    def on_body(self, i: int, acts: Scalar, inertia: ArticulatedInertia, bias: Force) -> None:
        """Add something that is nothing unless the mask `acts` holds."""
        old = self.IA[i], self.pA[i]
        self.IA[i], self.pA[i] = given(acts, lambda: (old[0] + inertia, old[1] + bias), old)

    def on_pair(self, i: int, j: int, acts: Scalar, inertia: ArticulatedInertia, bias: Force) -> None:
        """Likewise something that acts on body i one way, and on body j the other."""
        if (i, j) not in self.pairs:
            self.pairs[i, j] = Pull(acts, inertia, bias)
            return
        one = self.pairs[i, j]

        nothing = ArticulatedInertia.zero(), Force.zero()

        def both() -> tuple[ArticulatedInertia, Force]:
            # what does not act is not defined
            (IA, pA), (IB, pB) = either(one.acts, (one.IA, one.pA), nothing), either(acts, (inertia, bias), nothing)
            return IA + IB, pA + pB

        acting = where(one.acts, 1.0, where(acts, 1.0, 0.0)) > 0.5
        undefined = ArticulatedInertia.of([UNDEFINED] * 21), Force.of([UNDEFINED] * 6)
        self.pairs[i, j] = Pull(acting, *given(acting, both, undefined))

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


@dataclass(eq=False)
class Folded:
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
    def begin(tree: Tree, p: Sequence[Scalar], lines: Sequence[Line]) -> Folded:
        n = tree.mechanism.nbodies

        def plain(entries: Iterable[Scalar]) -> Iterator[Scalar]:
            # bits are the same if a load might act but does not
            return (unfolded(x, p) for x in entries)

        def loadable(inertia: ArticulatedInertia) -> ArticulatedInertia:
            H = Mat3(*(Vec3(*plain(row)) for row in inertia.H.rows))
            return ArticulatedInertia(Sym3(*plain(inertia.J)), H, Sym3(*plain(inertia.M)))

        nothing = Vec3(*plain((0.0, 0.0, 0.0)))
        IA, m = [loadable(tree.inertia(i).articulated()) for i in range(n)], len(lines)
        start = Folded(
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

    def copy(self, load: Load) -> Folded:
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
