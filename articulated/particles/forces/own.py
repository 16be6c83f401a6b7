"""Forces that users write."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.particles.check import elements, in_range, numbers, per_element, settle
from articulated.particles.forces.force import Force, Law
from articulated.particles.points import Point
from articulated.scalar import Scalar
from articulated.spatial import Vec3


@dataclass(frozen=True, eq=False)
class OwnLaw(Law):
    """A law of one's own, as plain Python over scalars; its derivatives are found from it.

    Attributes:
        law: `law(t, points, *values)`, the force on each of an element's particles [N], as a list of `Vec3`. Points have x, v
            and m; what it needs besides arithmetic is in `articulated.scalar` (sqrt, where …).
        groups: numbers of the particles of each element, shape (m, k); None: each particle is one.
        values: what the law is given of each element: each a number, or of shape (m,).
        energy_law: `energy_law(t, points, *values)`, the potential energy of an element [J]; None if it has none.
    """

    law: Callable[..., Sequence[Vec3]]
    groups: Any = None
    values: Sequence[Any] = ()
    energy_law: Callable[..., Scalar] | None = None

    def __post_init__(self) -> None:
        groups = None
        if self.groups is not None:
            groups = elements("OwnLaw: groups", self.groups, np.shape(self.groups)[1] if np.ndim(self.groups) == 2 else 1)
        values = [per_element(f"OwnLaw: values[{k}]", x, None, "element", -np.inf) for k, x in enumerate(self.values)]
        settle(self, groups=groups, values=tuple(values))

    def bound(self, x: np.ndarray, mass: np.ndarray) -> OwnLaw:
        if self.groups is not None:
            in_range("OwnLaw: groups", self.groups, len(x))
        for k, value in enumerate(self.values):
            per_element(f"OwnLaw: values[{k}]", value, len(x) if self.groups is None else len(self.groups), "element", -np.inf)
        return self

    @property
    def particles(self) -> np.ndarray | None:
        return self.groups

    @property
    def constants(self) -> tuple[np.ndarray, ...]:
        return tuple(self.values)

    @property
    def conservative(self) -> bool:
        return self.energy_law is not None

    def pull(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Sequence[Vec3]:
        return self.law(t, points, *constants)

    def potential(self, t: Scalar, points: Sequence[Point], *constants: Scalar) -> Scalar:
        return 0.0 if self.energy_law is None else self.energy_law(t, points, *constants)


@dataclass(frozen=True, eq=False)
class OwnForce(Force):
    """A function of all particles at once, on numpy arrays.

    Implicit solvers take it as constant over a step.

    Attributes:
        function: `function(t, x, v, mass)`, the force on each, shape (n, 3) [N].
    """

    function: Callable[[float, np.ndarray, np.ndarray, np.ndarray], np.ndarray]

    def force(self, t: float, x: np.ndarray, v: np.ndarray, mass: np.ndarray) -> np.ndarray:
        return numbers("OwnForce: what the function returned", self.function(t, x, v, mass), (len(x), 3))
