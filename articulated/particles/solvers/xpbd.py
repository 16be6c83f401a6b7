"""Position-based dynamics with compliance, and small steps: springs and bending are constraints that give way.

Macklin, Müller, Chentanez, XPBD (2016), algorithm 1 and equation 26; Macklin et al., Small Steps in Physics Simulation (2019):
a step is many substeps of one pass each. Each element has a constraint C of its particles' places, a compliance 1/k and a
damping d, and its λ is as if of an implicit Euler step:

    λ = −h² (k C + d Ċ),    m_i Δx_i = ∇_i C λ

Differs: it is written with k, not 1/k, so that k = 0 is nothing special; what is worked on is the way of each particle in the
substep, not its place: its rounding, over h, would be noise in velocities; elements that share no particle are worked on at
once, colour by colour. A spring has C = |c| − r along c = x_a − x_b. Bending has C = c, all three components of its curvature
c = Σ w_i x_i, as its energy is k |c|²/2: the gradient of each is w_i along one axis, so they do not meet, and one λ, a vector,
solves all three exactly. So both are elements with weights w, those of a spring 1 and −1.

symbol   meaning
c, C     Σ w_i x_i; the constraint, a vector that should vanish
d        way of each particle in a substep [m]
λ        h times the impulse of each element, a vector along C [N s²]
W        Σ w_i²/m_i
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from articulated.compiler import kernels_of
from articulated.particles.forces.bending import Bending
from articulated.particles.forces.springs import Springs
from articulated.particles.solvers.colours import independent
from articulated.particles.solvers.explicit import LAGS


@dataclass(frozen=True)
class XPBD:
    """Substeps in which springs and bending are solved one after the other: cheap, and no stiffness makes them blow up.

    One pass does not solve a substep: what is stiff gives way as if it were softer, most where long chains carry much, by about
    n² g h²/L of its length for a rope of n particles and length L that hangs, h a substep. So more substeps are better than
    more iterations: half of h is a quarter of that. Energy gets lost, as with implicit Euler, but may rise for a while too.

    All that is not `Springs` or `Bending` acts explicitly, as it is where a substep begins: weight, drag, wind, and laws of
    one's own, which may not be stiff.

    Attributes:
        substeps: of each step.
        iterations: passes over all elements in each substep.
    """

    substeps: int = 20
    iterations: int = 1

    def __post_init__(self) -> None:
        for name in ("substeps", "iterations"):
            if not isinstance(getattr(self, name), int) or getattr(self, name) < 1:
                raise ValueError(f"XPBD: {name} is {getattr(self, name)!r}; expected a whole number, 1 or more")

    def advance(self, system: Any, h: float) -> float:
        """Take a system on by h.

        Returns:
            By how much another pass, each element for itself, would change velocities, at most [m/s].
        """
        end, h = system.time + h, h / self.substeps
        colours, others = _colours(system), [force for force in system.forces if type(force) not in (Springs, Bending)]
        size = 0.0
        for left in reversed(range(self.substeps)):
            t, x, v = system.time, system.x, system.v
            f = sum((force.force(t, x, v, system.mass) for force in others), np.zeros_like(x))
            way = h * (v + h * system.inverse_mass[:, None] * f)
            impulses = [np.zeros((len(colour.particles), 3 if colour.rest is None else 1)) for colour in colours]
            for _ in range(self.iterations):
                for colour, impulse in zip(colours, impulses, strict=True):
                    change, along = colour.change(x, way, impulse, h)
                    impulse += change
                    way[colour.particles] += colour.share * along[:, None]
            if not left:
                size = max((c.speed(x, way, impulse, h) for c, impulse in zip(colours, impulses, strict=True)), default=0.0)
            system.arrive(h, x + way, way / h, LAGS["semi_implicit"])
        system.time = end
        return size


@dataclass(frozen=True, eq=False)
class Colour:
    """Elements of a law that share no particle.

    Attributes:
        particles: of each, shape (m, k).
        weights: w, shape (m, k, 1).
        share: w_i/m_i, zero for what is pinned, shape (m, k, 1) [1/kg].
        stiffness, damping: k and d, shape (m, 1).
        rest: r, shape (m, 1); None of bending.
    """

    particles: np.ndarray
    weights: np.ndarray
    share: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    rest: np.ndarray | None

    def change(self, x: np.ndarray, way: np.ndarray, impulse: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """What solves each element's constraint: how λ changes, and that as a vector, shape (m, 3)."""
        moved = (self.weights * way[self.particles]).sum(axis=1)
        c = (self.weights * x[self.particles]).sum(axis=1) + moved
        length = np.linalg.norm(c, axis=1, keepdims=True)
        u = c / np.where(length > 0.0, length, 1.0)  # a spring whose ends are in one place pushes nowhere
        C, rate = (c, moved) if self.rest is None else (length - self.rest, (u * moved).sum(axis=1, keepdims=True))
        k, d, W = h * h * self.stiffness, h * self.damping, (self.weights * self.share).sum(axis=1)
        change = -(k * C + impulse + d * rate) / ((k + d) * W + 1.0)
        return change, change if self.rest is None else change * u

    def speed(self, x: np.ndarray, way: np.ndarray, impulse: np.ndarray, h: float) -> float:
        """By how much what solves each element for itself would change velocities, at most [m/s]."""
        _, along = self.change(x, way, impulse, h)
        return float((np.abs(self.share[..., 0]).max(axis=1, initial=0.0) * np.linalg.norm(along, axis=1)).max(initial=0.0)) / h


def _colours(system: Any) -> list[Colour]:
    """All springs and bending of a system; which have which colour is found once."""
    laws = [force for force in system.forces if type(force) in (Springs, Bending)]
    known, key = kernels_of(system), (XPBD, system.forces)
    if (groups := known.get(key)) is None:
        groups = known[key] = [independent(law.particles) for law in laws]
    return [_colour(law, some, system.inverse_mass) for law, group in zip(laws, groups, strict=True) for some in group]


def _colour(law: Springs | Bending, some: np.ndarray, inverse_mass: np.ndarray) -> Colour:
    """Some elements of a law."""
    particles = law.particles[some]
    weights = np.array((1.0, -1.0)) if isinstance(law, Springs) else law.weights
    weights = np.broadcast_to(weights, law.particles.shape)[some, :, None]

    def own(value: np.ndarray) -> np.ndarray:
        return np.broadcast_to(value, len(law.particles))[some, None]

    share, rest = weights * inverse_mass[particles][..., None], own(law.rest_length) if isinstance(law, Springs) else None
    return Colour(particles, weights, share, own(law.stiffness), own(law.damping), rest)
