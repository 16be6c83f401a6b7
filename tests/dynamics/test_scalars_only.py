"""No algorithm asks for a scalar's value: they run on a scalar that refuses to tell it, and give what floats give."""

from __future__ import annotations

import math
import operator

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art
from articulated.dynamics import configuration, energy, kinematics, momentum, passive
from articulated.dynamics.forward_dynamics import forward_dynamics
from articulated.dynamics.inverse_dynamics import inverse_dynamics
from articulated.dynamics.jacobian import jacobian
from articulated.dynamics.loops.constrained import closed_state, constrained
from articulated.dynamics.mass_matrix import mass_matrix
from articulated.dynamics.mechanism import mechanism
from articulated.scalar import flatten, rebuilt
from articulated.simulation import dopri5
from articulated.simulation.contact.ground import Ground
from articulated.simulation.describe import described
from articulated.simulation.forces import Forces
from articulated.simulation.implicit.stance import Stance, Standing, unmoved
from articulated.simulation.implicit.step import semi_implicit_step
from articulated.simulation.runge_kutta import RK4, Point, runge_kutta_step


def _secret(x) -> float:
    return x._secret if isinstance(x, Opaque) else x


def _binary(function):
    return (
        lambda self, other: Opaque(function(self._secret, _secret(other))),
        lambda self, other: Opaque(function(_secret(other), self._secret)),
    )


class Opaque:
    """A scalar as a tracer sees it: it can be computed with, and nothing else."""

    __array_ufunc__ = None
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, secret):
        self._secret = secret

    def _refuse(self, *_):
        raise AssertionError("an algorithm asked for the value of a scalar")

    __bool__ = __float__ = __int__ = __index__ = __len__ = __iter__ = __abs__ = _refuse
    __add__, __radd__ = _binary(operator.add)
    __sub__, __rsub__ = _binary(operator.sub)
    __mul__, __rmul__ = _binary(operator.mul)
    __truediv__, __rtruediv__ = _binary(operator.truediv)
    __lt__, __gt__ = (_binary(f)[0] for f in (operator.lt, operator.gt))
    __le__, __ge__ = (_binary(f)[0] for f in (operator.le, operator.ge))
    __eq__ = _binary(operator.eq)[0]  # type: ignore[assignment]
    __and__, __rand__ = _binary(operator.and_)

    def __neg__(self):
        return Opaque(-self._secret)

    graph = None

    def repeat(self, count, body, carry, until):
        """All turns, whether they are needed or not: a tracer cannot know."""
        flat = [Opaque(0.0 + _secret(x)) for x in flatten(carry)]
        for _ in range(count):
            done = _secret(until(rebuilt(carry, iter(flat)))) if until else False
            new = flatten(body(rebuilt(carry, iter(flat))))
            flat = [a if done else Opaque(_secret(b)) for a, b in zip(flat, new, strict=True)]
        return rebuilt(carry, iter(flat))

    def given(self, value, otherwise):
        return rebuilt(otherwise, iter([self.where(a, b) for a, b in zip(flatten(value()), flatten(otherwise), strict=True)]))

    def where(self, a, b):
        return Opaque(_secret(a) if self._secret else _secret(b))

    def atan2(self, y, x):
        return Opaque(math.atan2(_secret(y), _secret(x)))

    def absolute(self):
        return Opaque(abs(self._secret))

    rounding = 2.0**-52


def _unary(function):
    return lambda self: Opaque(function(self._secret))


for _name in ("sin", "cos", "sqrt", "exp", "log"):
    setattr(Opaque, _name, _unary(getattr(math, _name)))


def hide(x):
    return [hide(y) for y in x] if isinstance(x, list) else Opaque(x)


def reveal(x):
    if isinstance(x, (list, tuple)):
        return [reveal(y) for y in x]
    if isinstance(x, (Point, Standing, Stance, dopri5.Slope)):
        return [reveal(y) for y in vars(x).values()]
    return _secret(x)


ALGORITHMS = {
    "forward_dynamics": lambda m, q, v, f, g: forward_dynamics(m, q, v, f.tau, g, f.external),
    "inverse_dynamics": lambda m, q, v, f, g: inverse_dynamics(m, q, v, f.tau, g, f.external),
    "mass_matrix": lambda m, q, v, f, g: mass_matrix(m, q),
    "jacobian": lambda m, q, v, f, g: jacobian(m, q, -1, v[:3]),
    "link_poses": lambda m, q, v, f, g: kinematics.link_poses(m, q),
    "link_velocities": lambda m, q, v, f, g: kinematics.link_velocities(m, q, v),
    "point_wrench": lambda m, q, v, f, g: kinematics.point_wrench(m, q, v[:3], f.tau[:3], g, -1),
    "center_of_mass": lambda m, q, v, f, g: momentum.center_of_mass(m, q),
    "momentum": lambda m, q, v, f, g: momentum.momentum(m, q, v),
    "kinetic_energy": lambda m, q, v, f, g: energy.kinetic_energy(m, q, v),
    "potential_energy": lambda m, q, v, f, g: energy.potential_energy(m, q, g),
    "integrate": lambda m, q, v, f, g: configuration.integrate(m, q, v),
    "difference": lambda m, q, v, f, g: configuration.difference(m, q, configuration.integrate(m, q, v)),
    "configuration_rate": lambda m, q, v, f, g: configuration.configuration_rate(m, q, v),
    "step_rate": lambda m, q, v, f, g: configuration.step_rate(m, f.tau, v),
    "passive_forces": lambda m, q, v, f, g: passive.passive_forces(m, v),
    "semi_implicit": lambda m, q, v, f, g: semi_implicit_step(Standing(q, v, 0.0 * g[0], unmoved(f.scene)), f, 0.001),
    "rk4": lambda m, q, v, f, g: runge_kutta_step(RK4, Point(q, v, 0.0 * g[0]), f, 0.001),
    "dopri5": lambda m, q, v, f, g: list(vars(dopri_step(m, q, v, f, g)).values()),
    "dopri5, interpolated": lambda m, q, v, f, g: dopri5.interpolated(m, dopri_step(m, q, v, f, g), 0.0005),
}


def dopri_step(m, q, v, f, g):
    start = dopri5.restarted(dopri5.begin(Point(q, v, 0.0 * g[0]), 0.001), f)
    return dopri5.attempt(start, f, 1.0, 1e-6, 1e-9)


@pytest.mark.parametrize("name", ALGORITHMS)
@pytest.mark.parametrize("seed", [7, 10, 2002])
def test_algorithm(name, seed):
    rig = random_rig(seed, mimic=True, armature=seed % 2 == 0, size=9).with_joints(damping=0.1, friction=0.1)
    m, rng = mechanism(rig), np.random.default_rng(seed)
    q, v, tau, external, g = (
        x.tolist()
        for x in (rig.random(rng), *rng.normal(size=(2, rig.nv)), rng.normal(size=(rig.nlinks, 6)), rng.normal(size=3))
    )
    run = ALGORITHMS[name]
    points = [art.ContactPoint(name, (0.1, 0.2, 0.3), 0.1) for name in list(rig.links)[-3:]]
    drives = art.PD(stiffness=10.0, damping=1.0, limit=1.0)
    scene, like, numbers = described(rig, Ground(restitution=0.5), points, True, drives, 1e-6)
    given, target = rebuilt(like, iter(numbers.tolist())), rig.random(rng).tolist()
    plain = run(m, q, v, Forces(scene, tau, external, g, given, target), g)
    hidden = run(m, hide(q), hide(v), Forces(scene, hide(tau), hide(external), hide(g), given, hide(target)), hide(g))
    assert reveal(hidden) == reveal(plain)


LOOPED = {
    "constrained_dynamics": lambda m, q, v, f, g: constrained(m, f.scene.loops, q, v, f.tau, g, f.external).a,
    "closed_state": lambda m, q, v, f, g: list(closed_state(m, f.scene.loops, q, v)),
    "semi_implicit": ALGORITHMS["semi_implicit"],
    "rk4": lambda m, q, v, f, g: runge_kutta_step(RK4, Point(q, v, 0.0 * g[0], [0.0] * len(f.scene.rows)), f, 0.001),
}


@pytest.mark.parametrize("name", LOOPED)
@pytest.mark.parametrize("seed", [7, 10])
def test_algorithm_with_loops(name, seed):
    rig = random_rig(seed, mimic=True, armature=True, size=9)
    m, rng = mechanism(rig), np.random.default_rng(seed)
    q, v, tau, external, g = (
        x.tolist()
        for x in (rig.random(rng), *rng.normal(size=(2, rig.nv)), rng.normal(size=(rig.nlinks, 6)), rng.normal(size=3))
    )
    a, b = [link.name for link in rig.links.values() if link.body >= 0][-2:]
    loops = [
        art.Loop("hinge", None, (0.1, 0.2, 0.3), a, None, axis=(0, 1, 0), name="hinge"),
        art.Loop("distance", None, None, b, None, length=0.7, name="rod"),
        art.Loop("distance", None, (1, 0, 0), b, None, length=0.1, rope=True, name="rope"),
    ]
    scene, like, numbers = described(rig, None, None, False, None, 1e-6, loops)
    given, run = rebuilt(like, iter(numbers.tolist())), LOOPED[name]
    plain = run(m, q, v, Forces(scene, tau, external, g, given), g)
    hidden = run(m, hide(q), hide(v), Forces(scene, hide(tau), hide(external), hide(g), given), hide(g))
    assert np.isfinite(flatten(reveal(plain))).all()
    assert reveal(hidden) == reveal(plain)


def test_the_probe_would_notice():
    with pytest.raises(AssertionError, match="asked for the value"):
        bool(Opaque(1.0) > 0.0)
