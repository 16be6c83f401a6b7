"""Runs: frames, batches, control, external forces, passive joints, and how a run may end."""

from __future__ import annotations

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art

FIXED = ["semi_implicit", "euler", "midpoint", "rk4"]


@pytest.fixture(scope="module")
def pendulum() -> art.Rig:
    builder = art.RigBuilder("pendulum")
    builder.link("pivot")
    builder.link("bob", 1.0, (0.0, 0.0, -1.0), (0.01, 0.01, 0.01))
    builder.joint("hinge", "revolute", "pivot", "bob", axis=(0, 1, 0))
    return builder.build()


class TestFrames:
    @pytest.mark.parametrize("integrator", list(art.INTEGRATORS))
    def test_times_and_shapes(self, pendulum, integrator):
        run = art.Simulation(pendulum, dt=0.01, integrator=integrator).run([[0.1], [0.2]], duration=0.5, fps=20)
        np.testing.assert_allclose(run.time, np.arange(11) / 20)
        assert run.fps == pytest.approx(20)
        assert run.q.shape == run.v.shape == run.tau.shape == (2, 11, 1)
        assert run.energy.shape == run.work.shape == (2, 11)
        np.testing.assert_array_equal(run.q[:, 0], [[0.1], [0.2]])
        assert (run.outcome == art.Outcome.COMPLETED).all()

    def test_steps_are_shortened_to_fall_on_frames(self, pendulum):
        run = art.Simulation(pendulum, dt=0.002).run(duration=0.1, fps=60)
        assert run.settings["dt"] == pytest.approx(1 / 540)
        run = art.Simulation(pendulum, dt=0.002, substeps=5).run(duration=0.1, fps=60)
        assert run.settings["dt"] == pytest.approx(1 / 600)
        run = art.Simulation(pendulum, dt=0.002).run(duration=0.1, fps=500)
        assert run.settings["dt"] == pytest.approx(0.002)

    def test_the_last_frame_is_the_last_that_the_duration_holds(self, pendulum):
        assert art.simulate(pendulum, 0.999, fps=10).time[-1] == pytest.approx(0.9)
        assert art.simulate(pendulum, 0.3, fps=10).time[-1] == pytest.approx(0.3)

    def test_a_frame_does_not_depend_on_later_ones(self, pendulum):
        short, long = (art.simulate(pendulum, d, q0=[0.5]) for d in (0.5, 1.0))
        np.testing.assert_array_equal(short.q, long.q[: len(short.time)])


class TestBatches:
    @pytest.mark.parametrize("integrator", list(art.INTEGRATORS))
    def test_a_state_does_not_feel_its_neighbours(self, integrator):
        rig = art.load("pendulum").with_joints(friction=1e-3)
        q0, v0 = rig.random(0, (2, 3)), np.random.default_rng(1).normal(size=(3, 6))
        simulation = art.Simulation(rig, dt=0.01, integrator=integrator)
        together = simulation.run(q0, v0, 0.3, 20)
        assert together.q.shape == (2, 3, 7, 8)
        for i, j in np.ndindex(2, 3):
            alone = simulation.run(q0[i, j], v0[j], 0.3, 20)
            np.testing.assert_allclose(together.q[i, j], alone.q, atol=1e-10)
            np.testing.assert_allclose(together.work[i, j], alone.work, atol=1e-10)

    def test_dopri5_steps_are_each_state_s_own(self, pendulum):
        """An easy state takes no shorter steps because its neighbour needs them: bit for bit the same."""
        simulation = art.Simulation(pendulum, integrator="dopri5")
        easy, hard = ([0.1], [0.0]), ([3.0], [40.0])
        pair = simulation.run([easy[0], hard[0]], [easy[1], hard[1]], 1.0)
        twins = simulation.run([easy[0], easy[0]], [easy[1], easy[1]], 1.0)
        np.testing.assert_array_equal(pair.q[0], twins.q[0])

    def test_state_of_a_batch(self, pendulum):
        run = art.simulate(pendulum, 0.1, q0=[[0.1], [0.2]])
        one = run.state(1)
        assert one.q.shape == (7, 1)
        np.testing.assert_array_equal(one.q, run.q[1])
        with pytest.raises(ValueError, match=r"state index \(0, 0\) has 2 entries; the batch has 1 axes"):
            run.state(0, 0)


class TestControl:
    def test_a_constant(self, pendulum):
        hold = art.gravity_forces(pendulum, [0.7])
        run = art.Simulation(pendulum).run([0.7], duration=1.0, control=hold)
        np.testing.assert_allclose(run.q, 0.7, atol=1e-12)
        np.testing.assert_array_equal(run.tau, np.broadcast_to(hold, run.tau.shape))

    @pytest.mark.parametrize("integrator", list(art.INTEGRATORS))
    def test_rows_over_time(self, pendulum, integrator):
        """Torque for half the time: the velocity is that of two constant accelerations."""
        inertia = art.mass_matrix(pendulum, [0.0])[0, 0]
        simulation = art.Simulation(pendulum, gravity=(0, 0, 0), integrator=integrator, dt=0.01)
        run = simulation.run([0.0], duration=1.0, fps=10, control=[[2.0], [0.0]])
        expected = 2.0 / inertia * np.minimum(run.time, 0.5)
        # the implicit step takes dt ω² a second from what turns
        tolerance = 1e-10 if integrator != "semi_implicit" else 0.01 * expected.max() ** 3
        np.testing.assert_allclose(run.v[:, 0], expected, atol=tolerance)
        np.testing.assert_array_equal(run.tau[:, 0], np.where(run.time < 0.499, 2.0, 0.0))

    def test_rows_for_each_state(self, pendulum):
        control = np.array([[[1.0], [0.0]], [[-1.0], [0.0]]])
        run = art.Simulation(pendulum, gravity=(0, 0, 0)).run(np.zeros((2, 1)), duration=1.0, control=control)
        np.testing.assert_allclose(run.q[0], -run.q[1])
        assert run.q[0, -1, 0] > 0.1

    def test_a_function_is_called_once_a_period_with_the_batch(self, pendulum):
        calls = []

        def control(t, state):
            calls.append((t, state.q.copy()))
            return -9.0 * state.q - 5.0 * state.v

        run = art.Simulation(pendulum, dt=0.005, substeps=2).run([[0.3], [0.6]], duration=1.0, fps=20, control=control)
        assert len(calls) == 100
        np.testing.assert_allclose([t for t, _ in calls], np.arange(100) / 100, atol=1e-12)
        np.testing.assert_array_equal(calls[5][1], run.q[:, 1])  # the fifth period starts the first frame after the start
        assert np.abs(run.q[:, -1]).max() < 0.1
        np.testing.assert_allclose(run.tau[:, 0], [[-2.7], [-5.4]])

    def test_a_function_may_give_nothing(self, pendulum):
        run = art.Simulation(pendulum, dt=0.01).run(
            [0.0], duration=1.0, fps=10, control=lambda t, state: [1.0] if t < 0.45 else None
        )
        np.testing.assert_array_equal(run.tau[:, 0], run.time < 0.45)

    def test_external_force(self):
        """A push on a free body through its centre."""
        builder = art.RigBuilder("box")
        builder.link("box", 2.0, inertia=(0.1, 0.1, 0.1))
        rig = builder.build("free")
        push = np.zeros((1, 6))
        push[0, :3] = (4.0, 0.0, 0.0)
        for external in (push, lambda t, state: push, np.broadcast_to(push, (7, 1, 6))):
            run = art.Simulation(rig, gravity=(0, 0, 0), integrator="rk4", dt=0.01).run(duration=1.0, fps=10, external=external)
            np.testing.assert_allclose(run.q[:, 0], 0.5 * 2.0 * run.time**2, atol=1e-12)
            np.testing.assert_allclose(run.work, 4.0 * run.q[:, 0], atol=1e-10)
            assert run.report

    def test_stepping_by_hand_is_running(self, pendulum):
        simulation = art.Simulation(pendulum, dt=0.01, substeps=2)
        run = simulation.run([0.5], [0.1], duration=0.2, fps=50, control=[0.3])
        state = simulation.reset([0.5], [0.1])
        for k in range(10):
            np.testing.assert_allclose(state.q, run.q[k], rtol=1e-12)
            state = simulation.step(state, [0.3])
        assert state.time == pytest.approx(0.2)
        np.testing.assert_allclose([state.q, state.v, [state.work]], [run.q[10], run.v[10], run.work[10:]], rtol=1e-12)

    @pytest.mark.parametrize("integrator", list(art.INTEGRATORS))
    def test_step_with_every_integrator(self, pendulum, integrator):
        simulation = art.Simulation(pendulum, dt=0.01, integrator=integrator)
        state = simulation.reset([[0.5], [0.7]])
        for _ in range(3):
            state = simulation.step(state, external=np.zeros((2, 6)))
        np.testing.assert_allclose(state.q, simulation.run([[0.5], [0.7]], duration=0.03, fps=100).q[:, -1], atol=1e-7)


class TestPassiveJoints:
    @pytest.mark.parametrize("integrator", ["semi_implicit", "rk4", "dopri5"])
    def test_damping_slows_exponentially(self, pendulum, integrator):
        rig = pendulum.with_joints(damping=0.5)
        rate = 0.5 / art.mass_matrix(rig, [0.0])[0, 0]
        run = art.Simulation(rig, gravity=(0, 0, 0), dt=1e-3, integrator=integrator).run([0.0], [2.0], 1.0)
        np.testing.assert_allclose(run.v[:, 0], 2.0 * np.exp(-rate * run.time), rtol=2e-3)
        assert run.report
        assert run.work[-1] < -0.5

    def test_stiff_damping_does_not_limit_the_step(self, pendulum):
        run = art.Simulation(pendulum.with_joints(damping=1e6), dt=0.01).run([1.0], [5.0], 1.0)
        np.testing.assert_allclose(run.q, 1.0, atol=1e-3)

    def test_friction_stops_in_finite_time(self, pendulum):
        rig = pendulum.with_joints(friction=1.0)
        run = art.Simulation(rig, gravity=(0, 0, 0)).run([0.0], [1.0], 2.0)
        stop = art.mass_matrix(rig, [0.0])[0, 0] * 1.0 / 1.0  # I v / friction
        before, after = run.v[run.time < 0.9 * stop, 0], run.v[run.time > 1.2 * stop, 0]
        np.testing.assert_allclose(before, 1.0 - run.time[: len(before)] / stop, atol=0.01)
        assert np.abs(after).max() < 1e-3

    def test_friction_holds_nearly_still(self, pendulum):
        """Below the limit it creeps, slower than the slip that smooths it."""
        run = art.Simulation(pendulum.with_joints(friction=12.0)).run([0.5], duration=1.0)
        assert 0 < 0.5 - run.q[-1, 0] < 0.01 * 1.0


class TestEnergy:
    @pytest.mark.parametrize("seed", range(3000, 3008))
    def test_work_is_the_change_of_energy(self, seed):
        """With torques, pushes, damping and friction, on random trees with followers."""
        rig = random_rig(seed, mimic=True, armature=True, size=6).with_joints(damping=0.2, friction=0.1)
        rng = np.random.default_rng(seed)
        q0, v0, tau = rig.random(rng), rng.normal(size=rig.nv), rng.normal(size=rig.nv)
        external = rng.normal(size=(rig.nlinks, 6))
        run = art.Simulation(rig, integrator="dopri5", rtol=1e-9, atol=1e-11).run(
            q0, v0, 0.5, 20, control=tau, external=external
        )
        assert np.abs(run.work).max() > 0.01
        assert run.report["energy drift"].value < 1e-6

    def test_semi_implicit_does_not_gain(self, pendulum):
        """It takes dt ω² a second from what turns: half of that with half the step, and it never gives."""
        lost = {}
        for dt in (0.002, 0.001):
            run = art.Simulation(pendulum, dt=dt, integrator="semi_implicit").run([2.0], duration=5.0, fps=50)
            rate = 2.0 * dt * np.trapezoid(run.kinetic_energy * run.v[:, 0] ** 2, run.time)
            lost[dt] = run.energy[0] - run.energy[-1]
            assert lost[dt] == pytest.approx(0.5 * rate, rel=0.05)
        assert lost[0.002] == pytest.approx(2.0 * lost[0.001], rel=0.05)

    @pytest.mark.parametrize("integrator", list(art.INTEGRATORS))
    def test_a_rig_that_does_not_move(self, integrator):
        run = art.Simulation(art.load('<robot name="rock"><link name="rock"/></robot>'), integrator=integrator).run(
            duration=0.1
        )
        assert run.q.shape == (7, 0)
        assert run.report


class TestOutcomes:
    def test_divergence_is_told_of(self, pendulum):
        with pytest.warns(RuntimeWarning, match=r"1 of 2 states of rig 'pendulum': diverged; the numbers overflowed: take a"):
            run = art.Simulation(pendulum.with_joints(damping=100.0), dt=0.1, integrator="euler").run(
                [[0.0], [0.1]], [[0.0], [1.0]], 30.0, 10
            )
        assert run.outcome.tolist() == [art.Outcome.COMPLETED, art.Outcome.DIVERGED]
        assert not run.report
        assert run.report.outcomes == {art.Outcome.COMPLETED: 1, art.Outcome.DIVERGED: 1}
        assert "1 state diverged: the numbers overflowed" in str(run.report)
        assert np.isfinite(run.q[0]).all()

    def test_divergence_of_one_state(self, pendulum):
        with pytest.warns(RuntimeWarning, match="diverged"):
            run = art.Simulation(pendulum.with_joints(damping=100.0), dt=0.1, integrator="rk4").run([0.1], [1.0], 30.0, 10)
        assert run.outcome == art.Outcome.DIVERGED

    def test_step_limit(self, pendulum):
        simulation = art.Simulation(pendulum, integrator="dopri5", max_steps=5)
        with pytest.warns(RuntimeWarning, match=r"1 of 2 states .* step limit; max_steps was reached before the end"):
            run = simulation.run([[0.0], [1.0]], [[0.0], [30.0]], 0.3)
        assert run.outcome.tolist() == [art.Outcome.COMPLETED, art.Outcome.STEP_LIMIT]
        assert np.isnan(run.q[1, -1])

    def test_step_too_small(self):
        """Into a gimbal lock: no step is short enough."""
        builder = art.RigBuilder("gimbal")
        for k in range(4):
            builder.link(f"l{k}", *((1.0, (0, 0, 0), (1, 1, 1)) if k == 3 else ()))
        for k, axis in enumerate([(0, 0, 1), (1, 0, 0), (0, 0, 1)], start=1):
            builder.joint(f"j{k}", "revolute", f"l{k - 1}", f"l{k}", axis=axis)
        with pytest.warns(RuntimeWarning, match="step too small"):
            run = art.Simulation(builder.build(), integrator="dopri5").run([0, 0, 0], [1, 0, 2], 0.1)
        assert run.outcome == art.Outcome.STEP_TOO_SMALL


class TestErrors:
    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"integrator": "magic"}, "integrator is 'magic'; expected one of semi_implicit, euler"),
            ({"dt": 0.0}, "dt is 0.0; expected a positive number"),
            ({"dt": float("nan")}, "dt is nan"),
            ({"dt": "fast"}, "dt is 'fast'"),
            ({"rtol": -1.0}, "rtol is -1.0"),
            ({"substeps": 0}, "substeps is 0; expected a positive integer"),
            ({"substeps": 1.5}, "substeps is 1.5"),
            ({"threads": 0}, "threads is 0"),
            ({"gravity": (0.0, 1.0)}, r"gravity has shape \(2,\); expected"),
            ({"gravity": np.zeros((2, 3))}, r"gravity has shape \(2, 3\); expected \(3,\)"),
        ],
    )
    def test_settings(self, pendulum, settings, message):
        with pytest.raises(ValueError, match=message):
            art.Simulation(pendulum, **settings)

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"duration": -1.0}, "duration is -1.0; expected a positive number"),
            ({"duration": float("inf")}, "duration is inf"),
            ({"duration": 0.001}, r"duration 0.001 s is shorter than one frame at 60 fps"),
            ({"fps": 0}, "fps is 0; expected a positive number"),
            ({"q0": [0.0, 0.0]}, r"q0 has shape \(2,\); expected \(\.\.\., 1\) for rig 'pendulum'"),
            ({"q0": [np.nan]}, r"q0\[0\] is nan \(hinge\); every entry must be finite"),
            ({"v0": [np.inf]}, r"v0\[0\] is inf \(hinge\)"),
            ({"q0": np.zeros((2, 1)), "v0": np.zeros((3, 1))}, r"leading axes do not broadcast: q0 \(2, 1\), v0 \(3, 1\)"),
            ({"control": [1.0, 2.0]}, r"control has shape \(2,\); expected \(\.\.\., 1\)"),
            ({"control": np.zeros((100, 1))}, r"control has shape \(100, 1\); expected .* for time, of 1 to 54 rows"),
            (
                {"control": np.zeros((2, 2, 1))},
                r"control has shape \(2, 2, 1\); expected \(\.\.\., 1\) with at most 0 leading axes",
            ),
            ({"control": [np.nan]}, r"control\[0\] is nan"),
            ({"control": lambda t, s: [1.0, 2.0]}, r"control\(t=0\) has shape \(2,\)"),
            ({"control": lambda t, s: [np.nan]}, r"control\(t=0\)\[0\] is nan \(hinge\)"),
            ({"external": np.zeros(6)}, r"external has shape \(6,\); expected \(\.\.\., 2, 6\)"),
            (
                {"q0": np.zeros((2, 1)), "control": np.zeros((3, 1))},
                r"control has shape \(3, 1\); it does not broadcast to the states' \(2, 1\)",
            ),
        ],
    )
    def test_run(self, pendulum, arguments, message):
        with pytest.raises(ValueError, match=message):
            art.Simulation(pendulum).run(**({"duration": 0.1} | arguments))

    def test_an_error_in_the_user_s_function_comes_through(self, pendulum):
        def control(t, state):
            raise KeyError("mine")

        with pytest.raises(KeyError, match="mine"):
            art.Simulation(pendulum).run(duration=0.1, control=control)


class TestProgress:
    def test_nothing_is_printed_unless_asked(self, pendulum, capsys):
        art.simulate(pendulum, 0.1)
        captured = capsys.readouterr()
        assert captured.out == captured.err == ""

    def test_a_bar_on_a_terminal(self, pendulum, monkeypatch):
        import tqdm

        art.Simulation(pendulum).run(duration=0.1)  # compiled before: that may show a bar too
        shown = []

        class Bar:
            def __init__(self, total, **settings):
                shown.append((total, settings["delay"]))

            def update(self, frames):
                shown.extend(["frame"] * frames)

            def close(self):
                shown.append("closed")

        monkeypatch.setattr(tqdm, "tqdm", Bar)
        art.Simulation(pendulum).run(duration=0.1, progress=True)
        assert shown == [(7, 2.0), *["frame"] * 7, "closed"]


class TestFirstOrder:
    @pytest.mark.parametrize("seed", [1, 2, 3])
    def test_solvers_agree(self, seed):
        from scipy.integrate import solve_ivp

        rig = random_rig(seed, mimic=True, size=5).with_joints(damping=0.3)
        rng = np.random.default_rng(seed)
        q0, v0, tau = rig.random(rng), rng.normal(size=rig.nv), rng.normal(size=rig.nv)
        system = art.first_order(rig, control=tau)
        solution = solve_ivp(system, (0.0, 0.5), system.pack(q0, v0), method="DOP853", rtol=1e-10, atol=1e-11)
        q, v = system.unpack(solution.y[:, -1])
        run = art.Simulation(rig, integrator="dopri5", rtol=1e-10, atol=1e-11).run(q0, v0, 0.5, 2, control=tau)
        np.testing.assert_allclose(art.difference(rig, q, run.q[-1]), 0.0, atol=1e-7)
        np.testing.assert_allclose(v, run.v[-1], atol=1e-6)

    def test_many_states_at_once(self):
        rig = art.load("pendulum", "free")
        system = art.first_order(rig)
        y = np.stack([system.pack(rig.random(k), np.ones(rig.nv)) for k in range(4)], axis=1)
        together = system(0.0, y)
        assert together.shape == y.shape
        for k in range(4):
            np.testing.assert_allclose(together[:, k], system(0.0, y[:, k]), atol=1e-10)

    def test_functions_of_time_and_state(self, pendulum):
        push = np.zeros((2, 6))
        push[1, 0] = 3.0
        system = art.first_order(
            pendulum, control=lambda t, q, v: -2.0 * v + t, external=lambda t, q, v: push, gravity=(0.0, 0.0, -1.0)
        )
        q, v = np.array([0.4]), np.array([0.7])
        rate = system(5.0, system.pack(q, v))
        expected = art.forward_dynamics(pendulum, q, v, -2.0 * v + 5.0, push, (0.0, 0.0, -1.0))
        np.testing.assert_allclose(rate, [0.7, *expected], rtol=1e-12)

    def test_errors(self, pendulum):
        with pytest.raises(ValueError, match=r"control has shape \(2,\)"):
            art.first_order(pendulum, control=[1.0, 2.0])
        with pytest.raises(ValueError, match=r"y has 3 rows; expected nq \+ nv = 2 for rig 'pendulum'"):
            art.first_order(pendulum)(0.0, np.zeros(3))
        with pytest.raises(ValueError, match=r"control\(t=2\) has shape \(2,\)"):
            art.first_order(pendulum, control=lambda t, q, v: [1.0, 2.0])(2.0, np.zeros(2))


@pytest.mark.parametrize("interpret", ["", "1"])
def test_a_step_takes_whatever_a_run_takes(pendulum, monkeypatch, interpret):
    """An array, an array of one row over time, a function."""
    monkeypatch.setenv("ARTICULATED_INTERPRET", interpret)
    simulation = art.Simulation(pendulum)
    state, tau = simulation.reset(), 0.1 * np.arange(1.0, pendulum.nv + 1.0)
    expected = simulation.step(state, tau).v
    assert np.abs(expected - simulation.step(state).v).max() > 1e-6
    for control in (tau[None], tau.tolist(), lambda t, at: tau + at.v):
        assert simulation.step(state, control).v.tobytes() == expected.tobytes()
