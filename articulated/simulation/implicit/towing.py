"""What particles that bodies carry do to these in a step: S and r of `particles.roots`, as numbers, in the place of G and g.

symbol   meaning
c        the point about which they are told
X        from velocities about O to those about c
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement

from articulated.dynamics.folded import Cross
from articulated.scalar import Scalar
from articulated.spatial import ArticulatedInertia, Force, Motion, Sym3, Vec3

Carriers = tuple[tuple[int, ...], ...]
"""Of each lot of particles the bodies that carry it."""


def size(carriers: Carriers) -> int:
    """How many numbers are told: c, then of each lot the upper triangle of S, then r."""
    return 3 + sum(n * (n + 1) // 2 + n for n in (6 * len(bodies) for bodies in carriers))


@dataclass(frozen=True, eq=False)
class Tow:
    """What particles do, about O.

    Attributes:
        inertia: of each body.
        cross: between two bodies of one lot.
        impulse: of each body.
        point: c.
    """

    inertia: dict[int, ArticulatedInertia] = field(default_factory=dict)
    cross: dict[tuple[int, int], list[Cross]] = field(default_factory=dict)
    impulse: dict[int, Force] = field(default_factory=dict)
    point: Vec3 = field(default_factory=Vec3.zero)

    @staticmethod
    def of(carriers: Carriers, numbers: Sequence[Scalar], origin: Vec3) -> Tow:
        """From its numbers, with O at `origin` in the world."""
        if not carriers:
            return Tow()
        tow, given = Tow(point=Vec3.of(numbers[:3]) - origin), iter(numbers[3:])
        for bodies in carriers:
            n = 6 * len(bodies)
            S = {place: next(given) for place in combinations_with_replacement(range(n), 2)}
            r = [next(given) for _ in range(n)]
            for a, i in enumerate(bodies):
                for b, j in list(enumerate(bodies))[a:]:
                    block = [[S[min(k, m), max(k, m)] for m in range(6 * b, 6 * b + 6)] for k in range(6 * a, 6 * a + 6)]
                    tow._add(i, j, Cross.of(block).about(tow.point))
                tow._push(i, Force.of(r[6 * a : 6 * a + 6]))
        return tow

    def _add(self, i: int, j: int, block: Cross) -> None:
        if i != j:
            self.cross.setdefault((i, j), []).append(block)
            return
        own = ArticulatedInertia(Sym3.upper(block.J), block.H, Sym3.upper(block.M))
        self.inertia[i] = self.inertia[i] + own if i in self.inertia else own

    def _push(self, i: int, about_c: Force) -> None:
        impulse = Force(about_c.angular + self.point.cross(about_c.linear), about_c.linear)
        self.impulse[i] = self.impulse[i] + impulse if i in self.impulse else impulse

    def given(self, V: Sequence[Motion]) -> dict[int, Force]:
        """What each body gets if these are the velocities at the end of the step."""
        result = {i: impulse - self.inertia[i] @ V[i] for i, impulse in self.impulse.items()}
        for (i, j), blocks in self.cross.items():
            for block in blocks:
                result[i] = result[i] - block @ V[j]
                result[j] = result[j] - block.transpose_times(V[i])
        return result

    def shown(self, carriers: Carriers, V: Sequence[Motion]) -> list[list[Scalar]]:
        """Velocities of the bodies, about c."""
        return [[*V[i].angular, *(V[i].linear + V[i].angular.cross(self.point))] for bodies in carriers for i in bodies]


def nothing(carriers: Carriers) -> list[list[Scalar]]:
    """As `Tow.shown`, at rest."""
    return [[0.0] * 6 for bodies in carriers for _ in bodies]
