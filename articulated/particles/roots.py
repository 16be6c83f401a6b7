"""Particles that bodies carry: what they do to these in an implicit step, and how the others follow.

A step is linear, the first turn of `solvers.implicit`, from velocities v̂ that are those of before, but for the roots: these
have what the bodies' velocities give them, J U. All others are given up, as a strand is from its tip to its root,

    S = A_RR − A_Rp A_pp⁻¹ A_pR,      r = b_R − A_Rp A_pp⁻¹ b_p,

and Jᵀ (r − S J (U − U₀)) is the impulse that bodies get: as that of a contact it depends on their velocities at the end of the
step, and makes one system with theirs. Once U is known, v_p = v̂_p + A_pp⁻¹ (b_p − A_pR J (U − U₀)). What particles gain bodies
lose: nothing is lost in between, however heavy or stiff they are.

symbol   meaning
U        velocities of the bodies, angular then linear at a common point c, one after the other
J        from U to the velocities of the roots
A, b     M + h D + h² K; M (v₀ − v̂) + h f, both where particles would go with v̂
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from articulated.particles import strands
from articulated.particles.forces.force import Law


@dataclass(frozen=True, eq=False)
class Felt:
    """What bodies feel: they get the impulses `impulse` − `inertia` U.

    Attributes:
        inertia: Jᵀ S J, shape (6 g, 6 g) for g bodies.
        impulse: shape (6 g,).
    """

    inertia: np.ndarray
    impulse: np.ndarray


class Roots:
    """The roots of a system, for one step after another: first `felt`, then `follow`."""

    def __init__(self, system: Any, roots: np.ndarray, owner: np.ndarray, bodies: int):
        """Of a system whose particles `roots` are carried, each by its `owner` among so many bodies."""
        self._system, self._roots, self._owner = system, np.asarray(roots), np.asarray(owner)
        self._bodies = bodies
        self._strands = self._bound()

    def felt(self, h: float, point: np.ndarray, U: np.ndarray) -> Felt:
        """Of a step of length h, with the bodies' velocities U about a point, shape (6 g,), as it begins."""
        system, roots = self._system, self._roots
        self._h, self._U = h, U
        self._J = self._jacobian(system.x[roots] - point)
        self._v = system.v.copy()
        self._v[roots] = self._J @ U
        carried = system.mass[roots, None] * (system.v[roots] - self._v[roots])  # a body may have turned since
        S, r = self._of_strands(carried) if self._strands is not None else self._of_all(carried)
        inertia = 0.5 * (S + S.T)
        return Felt(inertia, r + inertia @ U)

    def follow(self, U: np.ndarray, x: np.ndarray) -> None:
        """Move the system on: the bodies' velocities were U, and roots are at x, shape (roots, 3), at the end of the step."""
        system, change = self._system, U - self._U
        if self._strands is not None:
            self._follow_as_strands(change)
        else:
            v = self._v + self._alone - np.einsum("nck,k->nc", self._drawn, change)
            free = (system.inverse_mass > 0.0)[:, None]
            system.x, system.v = np.where(free, system.x + self._h * v, system.x), np.where(free, v, system.v)
        system.x[self._roots], system.v[self._roots] = x, self._J @ U
        system.time += self._h

    def _jacobian(self, r: np.ndarray) -> np.ndarray:
        """J of roots at r, about the common point, shape (roots, 3, 6 g)."""
        x, y, z = r.T
        zero = np.zeros_like(x)
        turned = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)
        J = np.zeros((len(r), 3, self._bodies, 6))
        some = np.arange(len(r))
        J[some, :, self._owner, :3], J[some, :, self._owner, 3:] = turned, np.eye(3)
        return J.reshape(len(r), 3, 6 * self._bodies)

    # strands with their first particle as root

    def _bound(self) -> strands.Bound | None:
        """If they are such."""
        system = self._system
        if not strands.are_strands(system):
            return None
        firsts = np.arange(system.chains.count) * system.chains.length
        if not np.array_equal(np.sort(self._roots), firsts):
            return None
        self._order = np.argsort(self._roots)
        return strands.bound_to(system, "rooted")

    def _of_strands(self, carried: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bound, system, count = self._strands, self._system, len(self._roots)
        assert bound is not None
        self._chained = bound.chained(system.x, self._v)
        self._numbers = np.array([system.time, self._h])
        bound.kernel.bound(self._chained, self._numbers, "in")(1, None)
        results = self._chained.ends[:, : bound.strands.scan.results]
        of_chain = results.transpose(0, 2, 1).reshape(-1, 9)[:count]
        own = np.empty_like(of_chain)
        own[self._order] = of_chain
        S = own[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(count, 3, 3)
        J = self._J
        return np.einsum("nck,ncd,ndl->kl", J, S, J, optimize=True), np.einsum("nck,nc->k", J, own[:, 6:] + carried)

    def _follow_as_strands(self, change: np.ndarray) -> None:
        bound, system = self._strands, self._system
        assert bound is not None
        scan, ends = bound.strands.scan, self._chained.ends
        passed = np.zeros((ends.shape[0] * ends.shape[2], scan.passed))
        passed[: len(self._roots), :3] = (self._J @ change)[self._order]
        ends[:, scan.results :] = passed.reshape(ends.shape[0], ends.shape[2], scan.passed).transpose(0, 2, 1)
        bound.kernel.bound(self._chained, self._numbers, "out")(1, None)
        system.x, system.v = bound.state(self._chained)

    # anything else

    def _of_all(self, carried: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        system, roots, J, h = self._system, self._roots, self._J, self._h
        t, there, n = system.time + h, system.x + h * self._v, len(system.x)
        A = matrix(system, t, there, self._v, h)
        b = h * system.force(t, there, self._v)
        b[roots] += carried
        free = system.inverse_mass > 0.0
        free[roots] = False
        rows, of_roots = np.repeat(free, 3), (3 * roots[:, None] + np.arange(3)).ravel()
        spread = J.reshape(-1, J.shape[2])
        drawn, alone = np.zeros((3 * n, J.shape[2])), np.zeros(3 * n)
        from_roots = A[:, of_roots] @ spread
        if rows.any():
            factor = splu(csc_array(A[rows][:, rows]), "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})
            drawn[rows], alone[rows] = factor.solve(from_roots[rows]), factor.solve(b.ravel()[rows])
        to_roots = A[of_roots]
        S = spread.T @ (from_roots[of_roots] - to_roots @ drawn)
        r = spread.T @ (b.ravel()[of_roots] - to_roots @ alone)
        self._drawn, self._alone = drawn.reshape(n, 3, -1), alone.reshape(n, 3)
        return S, r


def matrix(system: Any, t: float, x: np.ndarray, v: np.ndarray, h: float) -> csc_array:
    """A = M + h D + h² K of a system, made positive semidefinite, shape (3 n, 3 n); of laws: other forces stay as they are."""
    n = len(x)
    diagonal = np.arange(3 * n)
    values, rows, columns = [np.repeat(system.mass, 3)], [diagonal], [diagonal]
    for law in system.forces:
        if isinstance(law, Law):
            blocks = law.matrices(t, x, v, system.mass, h)
            numbers = np.arange(n)[:, None] if law.particles is None else law.particles
            places = 3 * numbers[:, :, None] + np.arange(3)
            shape = (*blocks.shape[:3], 3, 3)
            values.append(blocks.ravel())
            rows.append(np.broadcast_to(places[:, :, None, :, None], shape).ravel())
            columns.append(np.broadcast_to(places[:, None, :, None, :], shape).ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csc_array(coo_array(entries, shape=(3 * n, 3 * n)))
