"""Forward dynamics of a tree with closed loops, in world axes about a common origin; and what keeps loops closed.

symbol   meaning                                                        unit
V, A     velocity of a body, and its acceleration where no coordinate accelerates
F        force that a body would need not to accelerate but with A      N m, N
p        what is left for the coordinates, τ − C                        N m, N
φ, γ     gap of a row, and φ̈ where no coordinate accelerates            m, m/s²
λ        force of each row                                              N, N m

Featherstone, RBDA ch. 8, has the equations, M v̇ + C = τ + Jᵀ λ and J v̇ = −γ; the columns of J are folded with the tree, see
`sweep`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from articulated.dynamics.configuration import integrate
from articulated.dynamics.loops.closure import Closure, Line, jacobian, lines, sizes
from articulated.dynamics.loops.factor import Redundancy
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.dynamics.sweep import Sweep, Ties
from articulated.dynamics.tree import Tree, along_coordinates, force_at, in_world, tree
from articulated.scalar import Scalar
from articulated.spatial import Force, Motion, Vec3


@dataclass(frozen=True, eq=False)
class Constrained:
    """A looped rig at one state.

    Attributes:
        now: its tree.
        sweep: its linear system.
        a: generalized accelerations.
        forces: λ.
    """

    now: Tree
    sweep: Sweep
    a: list[Scalar]
    forces: list[Scalar]

    def projected(self, change: Sequence[Scalar]) -> list[Scalar]:
        """The least change of velocity, by kinetic energy, that gives the rows this change."""
        return self.now.out_of_world(self.sweep.corrected(change))


def constrained(
    m: Mechanism,
    closures: Sequence[Closure],
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    tau: Sequence[Scalar],
    gravity: Sequence[Scalar],
    external: Sequence[Sequence[Scalar]] | None = None,
    on_bodies: Sequence[Force | None] | None = None,
    rate: float = 0.0,
    known: Redundancy | None = None,
) -> Constrained:
    """Accelerations under these forces, as of `forward_dynamics`, and what loops add.

    `rate` [1/s]: gaps go to zero as fast as a critically damped spring of this frequency lets them (Baumgarte 1972). `known`
    is how rows repeat each other where they are closed; None if they are closed here.
    """
    now = tree(m, q)
    rows = lines(now, q, closures)
    v_world = in_world(now, v)
    V = now.velocities(v_world)
    A = now.accelerations(q, v_world, V, straight=False)
    F = _needed(now, V, A, gravity, external, on_bodies)
    p = [t - f for t, f in zip(in_world(now, tau), along_coordinates(now, F), strict=True)]
    ties = Ties(rows, sizes(closures), known=known, leaves_out=known is not None)
    sweep = Sweep(now, p, m.armature, ties=ties)
    closing = [(2.0 * rate) * line.speed(V, v_world) + (rate * rate) * line.gap for line in rows]
    target = [-(line.curvature(V, A) + x) for line, x in zip(rows, closing, strict=True)]
    _, _, pulls = sweep.solve(sweep.unloaded(), target)
    return Constrained(now, sweep, now.out_of_world(sweep.rest((), pulls)), pulls)


def closed_state(
    m: Mechanism, closures: Sequence[Closure], q: Sequence[Scalar], v: Sequence[Scalar], corrections: int = 2
) -> tuple[list[Scalar], list[Scalar]]:
    """The nearest configuration and velocity, by kinetic energy, with loops closed, from not far away."""
    begun, rows = rows_at(m, closures, q)
    sweep = tied(begun, rows, closures)
    for _ in range(corrections):
        gaps = [-line.gap for line in rows_at(m, closures, q)[1]]
        q = integrate(m, q, begun.out_of_world(sweep.corrected(gaps)))
    v = list(v)
    for _ in range(corrections):
        dv = begun.out_of_world(sweep.corrected([-x for x in speeds(*rows_at(m, closures, q), v)]))
        v = [a + b for a, b in zip(v, dv, strict=True)]
    return list(q), v


def tied(now: Tree, rows: Sequence[Line], closures: Sequence[Closure]) -> Sweep:
    """The linear system of a looped rig on which nothing acts."""
    m = now.mechanism
    return Sweep(now, [0.0] * m.nv, m.armature, ties=Ties(rows, sizes(closures)))


def speeds(now: Tree, rows: Sequence[Line], v: Sequence[Scalar]) -> list[Scalar]:
    """φ̇ of rows, for generalized velocities."""
    v_world = in_world(now, v)
    V = now.velocities(v_world)
    return [line.speed(V, v_world) for line in rows]


def rows_at(m: Mechanism, closures: Sequence[Closure], q: Sequence[Scalar]) -> tuple[Tree, list[Line]]:
    """The rows of loops at a configuration."""
    now = tree(m, q)
    return now, lines(now, q, closures)


def jacobian_rows(now: Tree, rows: Sequence[Line]) -> list[list[Scalar]]:
    """J as a full matrix, free roots' velocities in their own axes."""
    n = now.mechanism.nv
    return [now.out_of_world([row.get(s, 0.0) for s in range(n)]) for row in jacobian(now, rows)]


def _needed(
    now: Tree,
    V: Sequence[Motion],
    A: Sequence[Motion],
    gravity: Sequence[Scalar],
    external: Sequence[Sequence[Scalar]] | None,
    on_bodies: Sequence[Force | None] | None,
) -> list[Force]:
    """F of each body: I (A − g) + V ×* I V, less what acts on it from outside. RBDA 5.9, in world axes."""
    m, fall = now.mechanism, Motion(Vec3.zero(), Vec3.of(gravity))
    F = []
    for i in range(m.nbodies):
        inertia = now.inertia(i)
        F.append(inertia @ (A[i] - fall) + V[i].cross_force(inertia @ V[i]))
    for (i, X_BL), wrench in zip(m.links, external or (), strict=bool(external)):
        if i != WORLD:
            point = now.X[i].transform_point(X_BL.p)
            F[i] = F[i] - force_at(point, Vec3.of(wrench[:3]), Vec3.of(wrench[3:]))
    for i, f in enumerate(on_bodies or ()):
        if f is not None:
            F[i] = F[i] - now.X[i].force_to_parent(f)
    return F
