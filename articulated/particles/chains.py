"""Chains of particles: ropes, hair, whips. What an implicit step asks of them is solved exactly, from tip to root and back.

Where each particle acts on the next two at most, A of A x = r has blocks on few diagonals. The last particle is given up, then
the one before it: block elimination (Golub and Van Loan, Matrix Computations, 2013, 4.5.1), which takes as long as the chain
is, and fills nothing in. Chains of one length are solved side by side.

symbol   meaning
D        block of a particle with itself
E, F     its blocks with the one before it, and the one before that
P, Q     D⁻¹ E, D⁻¹ F
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from articulated.particles.forces.force import Force, Law
from articulated.scalar import Scalar
from articulated.spatial import Mat3, Sym3, Vec3

REACH = 2
"""How many before it a particle acts on."""


@dataclass(frozen=True)
class Chains:
    """Particles in chains of one length, one chain after the other.

    Attributes:
        count: of chains.
        length: of each, in particles.
    """

    count: int
    length: int

    @staticmethod
    def of(n: int, forces: Sequence[Force]) -> Chains | None:
        """The chains that particles are; None if they are none."""
        groups = [force.particles for force in forces if isinstance(force, Law) and force.particles is not None]
        groups = [some for some in groups if len(some)]
        if not groups or any(np.ptp(some, axis=1).max() > REACH for some in groups):
            return None
        ends = np.concatenate([np.stack([some[:, 0], other], axis=1) for some in groups for other in some.T[1:]])
        _, label = connected_components(coo_array((np.ones(len(ends)), ends.T), shape=(n, n)), directed=False)
        length = int(np.count_nonzero(label == label[0]))
        if n % length or length < REACH or (label.reshape(-1, length) != label[::length, None]).any():
            return None
        return Chains(n // length, length)

    def solve(self, blocks: np.ndarray, r: np.ndarray, held: np.ndarray) -> np.ndarray:
        """x with A x = r, zero for what is held.

        Args:
            blocks: D, E and F of each particle, shape (n, 3, 3, 3).
            r: shape (n, 3).
            held: mask, shape (n,).
        """
        blocks = np.where(held[:, None, None, None], 0.0, blocks)
        blocks[held, 0] = np.eye(3)
        for k in (1, 2):
            blocks[k:, k] *= ~held[: len(held) - k, None, None]
        lanes = blocks.reshape(self.count, self.length, 3, 3, 3).transpose(1, 2, 3, 4, 0)
        right = np.where(held[:, None], 0.0, r).reshape(self.count, self.length, 3).transpose(1, 2, 0)
        rows = [[Mat3.of(block) for block in three] for three in lanes]
        found = solved(rows, [Vec3(*x) for x in right])
        return np.stack([np.stack(list(x), axis=-1) for x in found], axis=1).reshape(-1, 3)


def band(system: Any, t: float, x: np.ndarray, v: np.ndarray, h: float) -> np.ndarray:
    """Of what `System.product` multiplies with, each particle's blocks with itself and the two before it, (n, 3, 3, 3)."""
    result = np.zeros((len(x), 1 + REACH, 3, 3))
    for force in system.forces:
        if not isinstance(force, Law):
            continue
        matrices = force.matrices(t, x, v, system.mass, h)
        numbers = np.arange(len(x))[:, None] if force.particles is None else force.particles
        for a, b in np.ndindex(matrices.shape[1:3]):
            before = numbers[:, a] - numbers[:, b]
            there = before >= 0
            np.add.at(result, (numbers[there, a], before[there]), matrices[there, a, b])
    return result


def solved(rows: Sequence[Sequence[Mat3]], right: Sequence[Vec3]) -> list[Vec3]:
    """x with A x = r, over scalars.

    Args:
        rows: D, E and F of each particle; what would be before the first is not looked at.
        right: r.
    """
    D, E, F = ([row[k] for row in rows] for k in range(3))
    r, P, Q = list(right), list(E), list(F)
    for i in reversed(range(len(rows))):
        inverse = Factor.of(Sym3.upper(D[i]))
        r[i], y = inverse.solve(r[i]), r[i]
        P[i], Q[i] = inverse.solve_each(E[i]), inverse.solve_each(F[i])
        if i > 0:
            D[i - 1], r[i - 1] = D[i - 1] - E[i].T @ P[i], r[i - 1] - P[i].transpose_times(y)
        if i > 1:
            E[i - 1] = E[i - 1] - E[i].T @ Q[i]
            D[i - 2], r[i - 2] = D[i - 2] - F[i].T @ Q[i], r[i - 2] - Q[i].transpose_times(y)
    x: list[Vec3] = []
    for i in range(len(rows)):
        new = r[i]
        if i > 0:
            new = new - P[i] @ x[i - 1]
        if i > 1:
            new = new - Q[i] @ x[i - 2]
        x.append(new)
    return x


@dataclass(frozen=True, eq=False)
class Factor:
    """A symmetric 3x3 matrix as L D Lᵀ: the entries of L below its diagonal, and the reciprocals of D."""

    yx: Scalar
    zx: Scalar
    zy: Scalar
    x: Scalar
    y: Scalar
    z: Scalar

    @staticmethod
    def of(A: Sym3) -> Factor:
        """Of a positive definite matrix. One quotient does for the last two: no other operation takes as long."""
        x = 1.0 / A.xx
        yx, zx = A.xy * x, A.xz * x
        yy, yz, zz = A.yy - yx * A.xy, A.yz - zx * A.xy, A.zz - zx * A.xz
        square = yy * zz - yz * yz
        both = 1.0 / (yy * square)
        y = square * both
        return Factor(yx, zx, yz * y, x, y, yy * yy * both)

    @staticmethod
    def where_free(A: Sym3, free: Scalar) -> Factor:
        """Of A where this is 1, which may be singular where it is 0: there all that is solved for is zero."""
        whole = Factor.of(A + Sym3.scaled_identity(1.0 - free))
        return replace(whole, x=whole.x * free, y=whole.y * free, z=whole.z * free)

    def solve(self, b: Vec3) -> Vec3:
        """A⁻¹ b."""
        y = b.y - self.yx * b.x
        z = (b.z - self.zx * b.x - self.zy * y) * self.z
        y = y * self.y - self.zy * z
        return Vec3(b.x * self.x - self.yx * y - self.zx * z, y, z)

    def solve_each(self, B: Mat3) -> Mat3:
        """A⁻¹ B."""
        return Mat3(*(self.solve(B.column(k)) for k in range(3))).T
