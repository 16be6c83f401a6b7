"""How the articulated-body algorithm gives up coordinates: block elimination, kept sparse by the tree.

A body and what hangs from it answer an acceleration a of the body, before its joint acts, with the force

    f = IA a + Σ U_s q̈_s + pA,      and each coordinate s still open obeys      U_sᵀ a + Σ D_st q̈_t = u_s.

A coordinate opens at its joint (U = IA S, D = Sᵀ IA S + armature, u = τ − Sᵀ pA: RBDA 7.43-7.45) and closes there too:
q̈_s is solved for and put into everything else, which is RBDA 7.26 and 7.47. Only a coordinate that several joints share
(a joint that follows another) stays open until all of them are in the subtree, carried along in body axes as U, D and u are.
Closing the several coordinates of one joint in turn is an LDLᵀ factorisation of its D.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from operator import attrgetter

from articulated.scalar import Scalar, is_zero, reciprocal
from articulated.spatial import ArticulatedInertia, Force, Motion, Pose, UnitMotion


@dataclass(eq=False)
class Row:
    """The equation of one open coordinate: Uᵀ a + Σ D_t q̈_t = u."""

    U: Force
    D: dict[int, Scalar]
    u: Scalar


@dataclass(eq=False)
class Closed:
    """A coordinate solved for: q̈ = (u − Uᵀ a − Σ D_t q̈_t) D_s⁻¹, with those t that were still open."""

    s: int
    U: Force
    Dinv: Scalar
    D: dict[int, Scalar]
    u: Scalar


@dataclass(eq=False)
class Elimination:
    """The coordinates given up at one body, and what is left for its parent: `IA`, `pA` and the rows still open."""

    IA: ArticulatedInertia
    pA: Force
    rows: dict[int, Row]
    closed: list[Closed] = field(default_factory=list)
    unloaded: dict[int, UnitMotion] = field(default_factory=dict)

    @staticmethod
    def none() -> Elimination:
        return Elimination.begin({})

    @staticmethod
    def begin(rows: dict[int, Row], IA: ArticulatedInertia | None = None, pA: Force | None = None) -> Elimination:
        """Start from what the subtree left open, and the body's own articulated inertia and bias force."""
        return Elimination(IA or ArticulatedInertia.zero(), pA or Force.zero(), rows)

    def open_joint(
        self,
        S: Sequence[Motion],
        coordinates: Sequence[int],
        tau: Mapping[int, Scalar] | Sequence[Scalar],
        armature: Mapping[int, Scalar] | Sequence[Scalar],
        follows: bool,
    ) -> None:
        """Let the body move along S as well: each column belongs to one coordinate, open already or not."""
        inherited = dict(self.rows)
        opened: list[tuple[int, Motion]] = []
        for column, s in zip(S, coordinates, strict=True):
            U = self.IA @ column
            if s not in self.rows:
                self.rows[s] = Row(Force.zero(), {s: 0.0}, 0.0)
            row = self.rows[s]
            for t, other in inherited.items():  # what open coordinates do to this column
                couple(self.rows, s, t, column.dot(other.U))
            for t, earlier in opened:
                couple(self.rows, s, t, earlier.dot(U))
            row.D[s] = row.D[s] + column.dot(U)
            row.u = row.u - column.dot(self.pA)
            opened.append((s, column))
            if not follows:
                row.D[s] = row.D[s] + armature[s]
                row.u = row.u + tau[s]
                if is_zero(armature[s]) and s not in inherited and isinstance(column, UnitMotion):
                    self.unloaded[s] = column
        for s, column in opened:
            self.rows[s].U = self.rows[s].U + self.IA @ column

    def couple(self, s: int, t: int, d: Scalar) -> None:
        """Add d to D_st and D_ts of two open coordinates."""
        couple(self.rows, s, t, d)

    def close(self, coordinates: Iterable[int]) -> None:
        """Give up these coordinates, the last first."""
        coordinates = list(coordinates)
        for s in reversed(coordinates):
            row = self.rows.pop(s)
            Dinv = reciprocal(row.D[s])
            Ud = row.U * Dinv
            others = {t: d for t, d in row.D.items() if t != s}
            for t, d in others.items():
                other = self.rows[t]
                other.U = other.U - Ud * d
                other.u = other.u - d * Dinv * row.u
                del other.D[s]
            for t, r in combinations_with_replacement(others, 2):
                value = self.rows[t].D.get(r, 0.0) - others[t] * Dinv * others[r]
                self.rows[t].D[r] = self.rows[r].D[t] = value
            self.IA = self.IA.minus_outer(row.U, Ud)
            self.pA = self.pA + Ud * row.u
            self.closed.append(Closed(s, row.U, Dinv, others, row.u))
        # what moves freely along a direction has no inertia that way: say so exactly
        for s in coordinates:
            if s in self.unloaded:
                self.IA = self.IA.without(self.unloaded[s])

    def carried_to_parent(self, X: Pose, c: Motion) -> dict[int, Row]:
        """The rows still open, for the parent's acceleration: a = X a_parent + c."""
        return {s: Row(X.force_to_parent(row.U), dict(row.D), row.u - c.dot(row.U)) for s, row in self.rows.items()}

    def solve(self, a: Motion, qdd: list[Scalar], u: Callable[[Closed], Scalar] = attrgetter("u")) -> None:
        """Fill in the accelerations of the coordinates given up here, for the body's acceleration without its joint.

        `u` tells the right side of each.
        """
        for closed in reversed(self.closed):
            rest = u(closed) - a.dot(closed.U)
            for t, d in closed.D.items():
                rest = rest - d * qdd[t]
            qdd[closed.s] = rest * closed.Dinv


def merged(parts: Sequence[dict[int, Row]]) -> dict[int, Row]:
    """The open rows of several children, seen from their parent: equations of the same coordinate add up."""
    rows: dict[int, Row] = {}
    for part in parts:
        for s, row in part.items():
            if s not in rows:
                rows[s] = row
                continue
            so_far = rows[s]
            D = dict(so_far.D)
            for t, d in row.D.items():
                D[t] = D[t] + d if t in D else d
            rows[s] = Row(so_far.U + row.U, D, so_far.u + row.u)
    return rows


def couple(rows: dict[int, Row], s: int, t: int, d: Scalar) -> None:
    """Add d to D_st and D_ts (twice to D_ss, where a joint meets another of its own coordinate)."""
    if s == t:
        rows[s].D[s] = rows[s].D[s] + (d + d)
        return
    for a, b in ((s, t), (t, s)):
        D = rows[a].D
        D[b] = D[b] + d if b in D else d
