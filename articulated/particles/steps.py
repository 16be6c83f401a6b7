"""The methods by name, and who takes their steps: machine code where it can, else the interpreter on arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from articulated.compiler.interpreter import interpreting
from articulated.particles import alone, strands, together, woven
from articulated.particles.resident import Laid
from articulated.particles.solvers.adaptive import Adaptive
from articulated.particles.solvers.explicit import EXPLICIT, LAGS
from articulated.particles.solvers.implicit import ImplicitEuler
from articulated.particles.solvers.xpbd import XPBD

_OTHERS = {"implicit_euler": ImplicitEuler, "adaptive": Adaptive, "xpbd": XPBD}
SOLVERS = (*EXPLICIT, *_OTHERS)

Solver = str | ImplicitEuler | Adaptive | XPBD


def method_of(solver: Solver) -> Solver:
    """The method of a name, or the method itself.

    Raises:
        ValueError: it is none.
    """
    method = _OTHERS[solver]() if isinstance(solver, str) and solver in _OTHERS else solver
    if not isinstance(method, tuple(_OTHERS.values())) and method not in EXPLICIT:
        others = ", ".join(f"{kind.__name__}(…)" for kind in _OTHERS.values())
        raise ValueError(f"solver is {method!r}; expected one of {', '.join(SOLVERS)}, or one of {others}")
    return method


def advance(system: Any, h: float, method: Any, steps: int, threads: int | None) -> tuple[float, int | None]:
    """Take a system so many steps on: what is left, see `System.step`; and flags of numbers, None if nobody looked."""
    key = method, system.forces, system.colliders
    laid = system.laid(key)
    if laid is None or interpreting():
        laid = _laid_out(system, method)
    if laid is not None:
        return system.go(key, laid, h, steps, threads)
    wide = system.at(system.x, system.v, system.time) if system.single else system
    with np.errstate(over="ignore", invalid="ignore"):
        residual = max((_step(wide, h, method) for _ in range(steps)), default=0.0)
    if wide is not system:
        system.x, system.v, system.time = wide.x, wide.v, wide.time
    return residual, None


def _laid_out(system: Any, method: Any) -> Laid | None:
    """Room for machine code that takes steps by a method; None if there is none yet."""
    if isinstance(method, ImplicitEuler) and method.turns == 1:
        if strands.are_strands(system):
            return strands.laid_out(system)
        if system.chains is None and woven.are_woven(system):
            return woven.laid_out(system, method.iterations)
    elif isinstance(method, str):
        if alone.are_alone(system.forces, system.colliders):
            return alone.laid_out(system, method)
        if together.are_laws(system.forces, method, system.colliders):
            return together.laid_out(system, method)
    return None


def _step(system: Any, h: float, method: Any) -> float:
    """A step of any method, on arrays: what is left."""
    if isinstance(method, (Adaptive, XPBD)):
        return method.advance(system, h)
    if isinstance(method, ImplicitEuler):
        x, v, residual = method.step(system, h)
        system.arrive(h, x, v, 0.0)
        return residual
    x, v = EXPLICIT[method](system.acceleration, system.time, h, system.x, system.v)
    system.arrive(h, x, v, LAGS[method])
    return 0.0
