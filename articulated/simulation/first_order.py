"""A rig as a first-order system, for any solver of ordinary differential equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import GRAVITY, Argument, checked
from articulated.dynamics.calls import call
from articulated.dynamics.configuration import configuration_rate
from articulated.dynamics.loops.closure import Closure
from articulated.dynamics.loops.functions import two_sided
from articulated.dynamics.mechanism import Mechanism
from articulated.rig import Loop, Rig
from articulated.scalar import Scalar
from articulated.simulation.forces import Forces, rate
from articulated.simulation.scene import Scene

_CLOSING = 20.0
"""How fast gaps of loops go to zero [1/s]."""


class FirstOrder:
    """ẏ = f(t, y) with y = (q, v), as `scipy.integrate.solve_ivp` takes it:

        system = art.first_order(rig)
        solution = solve_ivp(system, (0, 5), system.pack(q0, v0), method="DOP853")
        q, v = system.unpack(solution.y)

    A solver that knows nothing of quaternions lets their length drift by its own error; `f` looks at their direction
    only, and `unpack` returns unit ones.
    """

    def __init__(
        self,
        rig: Rig,
        control: Callable[[float, np.ndarray, np.ndarray], ArrayLike] | ArrayLike | None = None,
        external: Callable[[float, np.ndarray, np.ndarray], ArrayLike] | ArrayLike | None = None,
        gravity: ArrayLike = GRAVITY,
        loops: Sequence[Loop] | None = None,
    ):
        """See `first_order`."""
        self.rig, self._closures = rig, two_sided(rig, loops)
        self._control, self._external = control, external
        self._gravity = checked(rig, Argument("gravity", gravity, (3,)))
        if control is not None and not callable(control):
            self._control = checked(rig, Argument("control", control, (rig.nv,)))
        if external is not None and not callable(external):
            self._external = checked(rig, Argument("external", external, (rig.nlinks, 6)))

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        """ẏ, of the shape of y: (nq + nv,), or (nq + nv, k) for k states (`vectorized=True`)."""
        columns = np.moveaxis(np.asarray(y, dtype=float), 0, -1)
        q, v = self._split(columns)
        tau = self._given(self._control, "control", (self.rig.nv,), t, q, v)
        external = self._given(self._external, "external", (self.rig.nlinks, 6), t, q, v)
        tau = np.zeros(self.rig.nv) if tau is None else tau
        rig = self.rig
        arguments = [
            Argument("q", q, (rig.nq,)),
            Argument("v", v, (rig.nv,)),
            Argument("tau", tau, (rig.nv,)),
            Argument("external", external, (rig.nlinks, 6)),
            Argument("gravity", self._gravity, (3,), role="gravity"),
        ]
        # a solver may try what is no good: that is its own affair
        rate = call(rig, _rate, arguments, (rig.nq + rig.nv,), None, None, watched=False, closures=self._closures)
        return np.moveaxis(rate, -1, 0)

    def pack(self, q: ArrayLike, v: ArrayLike) -> np.ndarray:
        """y of a configuration, shape (nq,), and a velocity, shape (nv,)."""
        q = checked(self.rig, Argument("q", q, (self.rig.nq,), role="q"))
        v = checked(self.rig, Argument("v", v, (self.rig.nv,)))
        return np.concatenate([q, v], axis=-1)

    def unpack(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q, shape (..., nq), and v, shape (..., nv), of y, shape (nq + nv, ...)."""
        return self._split(np.moveaxis(np.asarray(y, dtype=float), 0, -1))

    def _split(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if columns.shape[-1] != self.rig.nq + self.rig.nv:
            raise ValueError(
                f"y has {columns.shape[-1]} rows; expected nq + nv = {self.rig.nq + self.rig.nv} for rig {self.rig.name!r}"
            )
        q, v = columns[..., : self.rig.nq].copy(), columns[..., self.rig.nq :]
        for where in self.rig.quaternions.values():
            q[..., where] /= np.linalg.norm(q[..., where], axis=-1, keepdims=True)
        return q, v

    def _given(self, what, name: str, shape: tuple[int, ...], t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray | None:
        if not callable(what):
            return what
        answer = what(t, q, v)
        return None if answer is None else checked(self.rig, Argument(f"{name}(t={t:g})", answer, shape))


def _rate(m: Mechanism, q, v, tau, external, gravity, closures: tuple[Closure, ...]) -> list[Scalar]:
    forces = Forces(Scene(m.rig, loops=closures), tau, external, gravity)
    return [*configuration_rate(m, q, v), *rate(q, v, forces, closing=_CLOSING).a]


def first_order(
    rig: Rig, control=None, external=None, gravity: ArrayLike = GRAVITY, loops: Sequence[Loop] | None = None
) -> FirstOrder:
    """The phase-space form of a rig's motion: state in, derivative out. Joint damping and friction act, and loops.

    Gaps of loops go to zero by themselves, but not at once: what a solver leaves open stays within its tolerance.

    Args:
        rig: the rig.
        control: generalized forces, shape (..., nv) [N m, N], or a function of t, q and v that gives them.
        external: wrenches on links, (force, couple) in the world at the link origin, shape (..., nlinks, 6) [N, N m], or
            such a function.
        gravity: acceleration of free fall, in the world, shape (3,) [m/s²].
        loops: what closes the rig; None for its own. Not ropes.

    Raises:
        ValueError: an array or a loop does not fit the rig, or an array is not finite.
    """
    return FirstOrder(rig, control, external, gravity, loops)
