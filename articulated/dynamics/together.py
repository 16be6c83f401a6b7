"""Coordinates given up together: where bodies act on each other, the tree is no order in which to give them up.

What acts with G at x on body i, and against it on body j, sees u = (ω_i − ω_j) × x + l_i − l_j, and K = Xᵀ G X is an inertia of
the one relative to the other. With c_s the motion of i in j for a unit of coordinate s,

    H_st = S_sᵀ Ic S_t + Σ c_sᵀ K c_t,

where Ic is what RBDA 6.14 calls the composite inertia, of whatever hangs from the body and has been folded or not. Only
coordinates between the two bodies have a c: what carries both alike does not feel K.

H is factored as LDLᵀ, limb by limb, those with the fewest neighbours first. Limbs of which none touches another have no entries
together, nor have things that stand on each other but for neighbours: of what the pattern of H may have, only that is computed
which some state of a group has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations, combinations_with_replacement

from articulated.dynamics.elimination import Closed, Elimination, Row, couple, merged
from articulated.dynamics.folded import Cross, Folded, Load, Pull
from articulated.dynamics.loops.factor import elimination_order
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.dynamics.tree import Tree
from articulated.scalar import Scalar, as_written, given, is_zero, maximum, reciprocal, where
from articulated.spatial import ArticulatedInertia, Force, Motion

Pair = tuple[int, int]
Couple = tuple[int, int]
"""Two groups of coordinates, by number, the first given up before the second."""
Entries = dict[tuple[int, int], Scalar]

_NONE: Mapping[Pair, Sequence[Cross]] = {}
_SQUARE = 4
"""Side of the squares of entries that are factored at once."""


class Together:
    """The bodies that act on each other, and those that carry them.

    Attributes:
        pairs: of bodies.
        bodies: all of these.
    """

    def __init__(self, tree: Tree, pairs: Iterable[Pair], cross: Mapping[Pair, Sequence[Cross]] = _NONE):
        m = self._mechanism = tree.mechanism
        self._tree, self.pairs, self._cross = tree, list(dict.fromkeys(pairs)), cross
        self.bodies = {k for pair in (*self.pairs, *cross) for i in pair for k in m.support(i)}
        self._between = {pair: _between(tree, *pair) for pair in self.pairs}

    def elimination(self, folded: Folded, load: Load, p: Sequence[Scalar], mass: Sequence[Scalar]) -> Elimination:
        """Give up all of their coordinates; everything else has been folded into them.

        `p` and `mass` are the right side and what is added to D, as of the sweep.
        """
        rows = self._rows(folded, load, p, mass)
        for pair, pull in load.pairs.items():
            self._add(rows, pull, self._between[pair])
        for (i, j), blocks in self._cross.items():
            for block in blocks:
                self._add_cross(rows, block, *(_between(self._tree, k, WORLD) for k in (i, j)))
        groups, coupled = self._groups(rows, load)
        return Elimination(ArticulatedInertia.zero(), Force.zero(), {}, _closed(rows, groups, coupled))

    def _groups(self, rows: Mapping[int, Row], load: Load) -> tuple[list[list[int]], dict[Couple, Scalar]]:
        """Coordinates of each limb together, in the order in which to give them up; and which of these are coupled."""
        m = self._mechanism
        children = {i: [k for k in self.bodies if m.parent[k] == i] for i in (*self.bodies, WORLD)}
        limb: dict[int, int] = {}  # the highest body of each one's limb
        for i in sorted(self.bodies):
            above = m.parent[i]
            limb[i] = limb[above] if above != WORLD and len(children[above]) == 1 else i
        of = {s: limb[i] for i in sorted(self.bodies, reverse=True) for s in m.joints[i].v}
        names = list(dict.fromkeys(of[s] if s in of else -2 - s for s in rows))
        number = {s: names.index(of[s] if s in of else -2 - s) for s in rows}
        coupled: dict[Couple, Scalar] = {}

        def add(some: Iterable[int], acts: Scalar) -> None:
            for g, h in combinations(sorted({number[s] for s in some}), 2):
                coupled[g, h] = _either(coupled.get((g, h), 0.0), acts)

        for i in self.bodies:
            add([s for k in m.support(i) for s in m.joints[k].v if s in rows], True)
        for s, row in rows.items():
            if s not in of:  # several joints share it
                add([s, *row.D], True)
        for pair, pull in load.pairs.items():
            add(self._between[pair], where(pull.acts, 1.0, 0.0))
        for i, j in self._cross:
            add({s for k in (i, j) for s in _between(self._tree, k, WORLD)}, True)
        order = elimination_order(coupled, len(names))
        place = {g: n for n, g in enumerate(order)}
        groups = [[s for s in rows if number[s] == g] for g in order]
        return groups, {tuple(sorted((place[g], place[h]))): acts for (g, h), acts in coupled.items()}  # type: ignore[misc]

    def _rows(self, folded: Folded, load: Load, p: Sequence[Scalar], mass: Sequence[Scalar]) -> dict[int, Row]:
        """The equations of these coordinates without what acts between bodies."""
        m, S = self._mechanism, self._tree.S
        rows: dict[int, Row] = merged(folded.open[WORLD])

        def row(s: int) -> Row:
            return rows.setdefault(s, Row(Force.zero(), {s: 0.0}, 0.0))

        for i in sorted(self.bodies, reverse=True):
            joint, above = m.joints[i], [k for k in m.support(i) if k != i]
            for s, open_row in merged(folded.open[i]).items():
                row(s).u = row(s).u + open_row.u
                for t, d in open_row.D.items():
                    row(t).D[s] = row(t).D.get(s, 0.0) + d
                self._carry(rows, s, open_row.U, [i, *above])
            for n, (column, s) in enumerate(zip(S[i], joint.v, strict=True)):
                U = folded.IA[i] @ column
                row(s).D[s] = row(s).D[s] + column.dot(U)
                row(s).u = row(s).u - column.dot(folded.pA[i])
                if not joint.follows:
                    row(s).D[s] = row(s).D[s] + (mass[s] + load.mass[s] if s in load.mass else mass[s])
                    row(s).u = row(s).u + (p[s] + load.p[s] if s in load.p else p[s])
                for other, t in list(zip(S[i], joint.v, strict=True))[:n]:
                    couple(rows, s, t, other.dot(U))
                self._carry(rows, s, U, above)
            if (parent := m.parent[i]) != WORLD:
                folded.IA[parent] = folded.IA[parent] + folded.IA[i]
                folded.pA[parent] = folded.pA[parent] + folded.pA[i]
        for (s, t), d in load.between.items():
            if s in rows:
                couple(rows, s, t, d)
        return rows

    def _carry(self, rows: dict[int, Row], s: int, U: Force, bodies: Iterable[int]) -> None:
        """Couple a coordinate that takes this force with the joints that bear it."""
        for k in bodies:
            for column, t in zip(self._tree.S[k], self._mechanism.joints[k].v, strict=True):
                if t not in rows:
                    rows[t] = Row(Force.zero(), {t: 0.0}, 0.0)
                couple(rows, s, t, column.dot(U))

    @staticmethod
    def _add(rows: dict[int, Row], pull: Pull, between: Mapping[int, Motion]) -> None:
        """Add what acts between two bodies, unless nothing does."""
        entries = list(combinations_with_replacement(between, 2))

        def added() -> Iterator[Scalar]:
            U = {s: pull.IA @ c for s, c in between.items()}
            yield from (rows[s].D.get(t, 0.0) + between[t].dot(U[s]) for s, t in entries)
            yield from (rows[s].u - c.dot(pull.pA) for s, c in between.items())

        old = [*(rows[s].D.get(t, 0.0) for s, t in entries), *(rows[s].u for s in between)]
        new = given(pull.acts, lambda: list(added()), old)
        for (s, t), d in zip(entries, new, strict=False):
            rows[s].D[t] = rows[t].D[s] = d
        for s, u in zip(between, new[len(entries) :], strict=True):
            rows[s].u = u

    @staticmethod
    def _add_cross(rows: dict[int, Row], block: Cross, own: Mapping[int, Motion], other: Mapping[int, Motion]) -> None:
        """Add what ties the momenta of one body to the velocities of another, and the reverse."""
        for t, column in other.items():
            U = block @ column
            for s, motion in own.items():
                d = motion.dot(U)
                new = rows[s].D.get(t, 0.0) + (d + d if s == t else d)
                rows[s].D[t] = rows[t].D[s] = new


def _closed(rows: Mapping[int, Row], groups: Sequence[Sequence[int]], coupled: dict[Couple, Scalar]) -> list[Closed]:
    """The coordinates solved for, group after group: LDLᵀ, and the right side with it.

    `coupled` has whether groups have entries together: True, or 1 or 0, or none at all; what becomes coupled is added.
    """
    H = {(s, t): d for s, row in rows.items() for t, d in row.D.items()}
    u = {s: row.u for s, row in rows.items()}
    Dinv: dict[int, Scalar] = {}
    some = list(u.values())
    for g, group in enumerate(groups):
        others = [h for h in range(g + 1, len(groups)) if (g, h) in coupled]
        as_written(lambda group=group: _give_up(H, u, Dinv, group), some)
        for h in others:
            _where(coupled[g, h], H, u, groups[h], group, lambda H, u, g=group, h=groups[h]: _carry_on(H, u, Dinv, g, h))
        for n, h in enumerate(others):
            for k in others[n:]:
                acts = _both(coupled[g, h], coupled[g, k])
                if h != k:
                    coupled[h, k] = _either(coupled.get((h, k), 0.0), acts)
                _where(
                    acts, H, {}, groups[h], groups[k], lambda H, _, a=groups[h], b=groups[k], g=group: _take(H, Dinv, a, b, g)
                )
    order = [s for group in groups for s in group]
    closed = []
    for n, s in enumerate(order):
        closed.append(Closed(s, Force.zero(), Dinv[s], {t: H[t, s] for t in order[n + 1 :] if (t, s) in H}, u[s]))
    return closed


def _give_up(H: Entries, u: dict[int, Scalar], Dinv: dict[int, Scalar], group: Sequence[int]) -> None:
    """Factor a group's own entries."""
    for n, k in enumerate(group):
        Dinv[k] = reciprocal(H[k, k])
        for m, i in enumerate(group[n + 1 :], n + 1):
            if (i, k) in H:
                scaled = H[i, k] * Dinv[k]
                u[i] = u[i] - scaled * u[k]
                for j in group[n + 1 : m + 1]:
                    if (j, k) in H:
                        H[i, j] = H.get((i, j), 0.0) - scaled * H[j, k]


def _carry_on(
    H: Entries, u: dict[int, Scalar], Dinv: Mapping[int, Scalar], group: Sequence[int], others: Sequence[int]
) -> None:
    """What giving up a group does to the entries that others have with it, and to their right sides."""
    for n, k in enumerate(group):
        for i in others:
            if (i, k) in H:
                scaled = H[i, k] * Dinv[k]
                u[i] = u[i] - scaled * u[k]
                for j in group[n + 1 :]:
                    if (j, k) in H:
                        H[i, j] = H.get((i, j), 0.0) - scaled * H[j, k]


def _take(H: Entries, Dinv: Mapping[int, Scalar], rows: Sequence[int], columns: Sequence[int], group: Sequence[int]) -> None:
    """What it does to entries that others have with each other, a square of them at a time: so it happens in registers."""
    for first in range(0, len(rows), _SQUARE):
        for k in group:
            for i in rows[first : first + _SQUARE]:
                if (i, k) in H:
                    scaled = H[i, k] * Dinv[k]
                    for j in columns:
                        if (j, k) in H and (rows is not columns or rows.index(j) <= rows.index(i)):
                            H[j, i] = H[i, j] = H.get((i, j), 0.0) - scaled * H[j, k]


def _where(
    acts: Scalar,
    H: Entries,
    u: dict[int, Scalar],
    a: Sequence[int],
    b: Sequence[int],
    change: Callable[[Entries, dict[int, Scalar]], None],
) -> None:
    """Let something change the entries of two groups with each other, and right sides, where it acts."""
    new_H, new_u = dict(H), dict(u)
    if acts is True:
        as_written(lambda: change(new_H, new_u), list(H.values()))
        H.update(new_H)
        u.update(new_u)
        return
    places = [(i, j) for i in a for j in b]

    def changed() -> list[Scalar]:
        change(new_H, new_u)
        return [new_H.get(place, 0.0) for place in places] + [new_u[i] for i in a if i in new_u]

    old = [H.get(place, 0.0) for place in places] + [u[i] for i in a if i in u]
    new = given(acts > 0.5, changed, old)
    for (i, j), x in zip(places, new, strict=False):
        H[i, j] = H[j, i] = x
    u.update(zip([i for i in a if i in u], new[len(places) :], strict=True))


def _both(a: Scalar, b: Scalar) -> Scalar:
    return b if a is True else a if b is True else a * b


def _either(a: Scalar, b: Scalar) -> Scalar:
    return True if a is True or b is True else b if is_zero(a) else maximum(a, b)


def fill(m: Mechanism, pairs: Iterable[Pair]) -> int:
    """How many multiply-adds it takes to factor H."""
    some = list(dict.fromkeys(pairs))
    bodies = {k for pair in some for i in pair for k in m.support(i)}
    coordinates = sorted({s for i in bodies for s in m.joints[i].v})
    places = {s: k for k, s in enumerate(coordinates)}
    groups = [[s for k in m.support(i) for s in m.joints[k].v] for i in bodies]
    groups += [[s for k in set(m.support(i)) ^ set(m.support(j)) for s in m.joints[k].v] for i, j in some]
    neighbours: list[set[int]] = [set() for _ in coordinates]
    for group in groups:
        members = {places[s] for s in group}
        for k in members:
            neighbours[k] |= members
    entries = [(j, k) for j, others in enumerate(neighbours) for k in others]
    total = 0
    for k in elimination_order(entries, len(coordinates)):
        around = neighbours[k] - {k}
        total += len(around) * (len(around) + 1) // 2
        for j in around:
            neighbours[j] = (neighbours[j] | around) - {k}
    return total


def _between(tree: Tree, i: int, j: int) -> dict[int, Motion]:
    """c: of body i relative to body j for each coordinate that moves them apart."""
    m, result = tree.mechanism, {}
    ways = m.support(i), m.support(j)
    for way, other, sign in ((*ways, 1.0), (*reversed(ways), -1.0)):
        for k in way:
            if k not in other:
                for column, s in zip(tree.S[k], m.joints[k].v, strict=True):
                    c = column * sign if sign < 0.0 else column
                    result[s] = result[s] + c if s in result else c
    return result
