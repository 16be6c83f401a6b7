"""A state that machine code has laid out: what is looked at, changed or copied is that of now, however it went on."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from articulated import particles as ap

H = 2e-3


def system():
    made = ap.grid_cloth((0, 0, 1), (1, 0, 0), (0, 1, 0), 5, 4, 0.2, 100.0)
    return ap.System(made.x, None, made.mass, [ap.Gravity(), *made.forces], pinned=[0])


@pytest.mark.parametrize("solver", ["semi_implicit", ap.ImplicitEuler(turns=1), "implicit_euler"])
def test_looking_changes_nothing(solver):
    one, other = system(), system()
    for _ in range(5):
        one.step(H, solver)
        other.step(H, solver)
        assert np.isfinite(other.x).all()
    assert one.state.tobytes() == other.state.tobytes()


def test_methods_take_turns():
    one, other = system(), system()
    for solver in ("semi_implicit", ap.ImplicitEuler(turns=1), "semi_implicit", "euler"):
        one.step(H, solver, 3)
        other.step(H, solver, 3)
        other.x = other.x.copy()
    assert one.state.tobytes() == other.state.tobytes()
    assert one.time == other.time == pytest.approx(12 * H)


def test_what_is_changed_counts():
    one, other = system(), system()
    one.step(H, steps=4)
    one.x[7] += 0.01  # in place
    one.step(H, steps=4)
    other.step(H, steps=4)
    x = other.x.copy()
    x[7] += 0.01
    other.x = x
    other.step(H, steps=4)
    np.testing.assert_allclose(one.x, other.x, rtol=0, atol=1e-13)
    assert np.abs(one.x - x).max() > 1e-4
    with pytest.raises(ValueError, match="read-only"):
        one.mass[3] = 1.0


def test_other_forces_take_the_place_of_those_before():
    """Springs that are as long as they are by then; and a net is no chain any more."""
    x = np.array([(0, 0, 0), (1.0, 0, 0), (2.0, 0, 0)])
    one = ap.System(x, None, 1.0, [ap.Springs([(0, 1), (1, 2)], 50.0)])
    one.step(H, ap.ImplicitEuler(turns=1))
    one.x = 2.0 * x
    one.forces = [ap.Springs([(0, 1), (1, 2), (2, 0)], 50.0), ap.Acceleration(lambda t, x: x * 0.0)]
    for solver in ("semi_implicit", "implicit_euler", ap.ImplicitEuler(turns=1)):
        one.step(H, solver, 5)
    np.testing.assert_allclose(one.x, 2.0 * x, atol=1e-12)
    with pytest.raises(ValueError, match="there are 3 particles"):
        one.forces = [ap.Springs([(0, 7)], 1.0)]
    with pytest.raises(ValueError, match="forces holds 7"):
        one.forces = [7]
    with pytest.raises(ValueError, match="colliders holds 7"):
        one.colliders = [7]
    one.step(H)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_copies_go_their_own_way(copied):
    one, alone = system(), system()
    one.step(H, steps=3)
    other = copied(one)
    other.step(H, steps=5)
    one.step(H, steps=2)
    alone.step(H, steps=5)
    assert one.state.tobytes() == alone.state.tobytes()
    assert other.time == pytest.approx(8 * H)
    assert np.abs(other.x - one.x).max() > 1e-5
