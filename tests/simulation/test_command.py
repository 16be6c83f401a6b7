"""Commands to drives: gains that change, forces besides, a root that is helped; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import articulated as art


@pytest.fixture(scope="module")
def rig() -> art.Rig:
    builder = art.RigBuilder("arm")
    builder.link("base", 2.0, inertia=(0.1, 0.1, 0.1))
    builder.link("upper", 1.0, (0, 0, -0.2), (0.02, 0.02, 0.01))
    builder.link("lower", 1.0, (0, 0, -0.2), (0.02, 0.02, 0.01))
    builder.joint("shoulder", "ball", "base", "upper")
    builder.joint("elbow", "revolute", "upper", "lower", xyz=(0, 0, -0.4), axis=(0, 1, 0), limits=art.Limits(-2.0, 2.0))
    return builder.build("free")


HELP = art.RootHelp((500.0, 50.0), (100.0, 10.0))


@pytest.fixture(scope="module")
def simulation(rig) -> art.Simulation:
    return art.Simulation(rig, dt=0.005, actuation=art.PD(30.0, 3.0, help=HELP))


@pytest.fixture(scope="module")
def limited(rig) -> art.Simulation:
    return art.Simulation(rig, dt=0.005, actuation=art.PD(30.0, 3.0, limit=2.0))


def bent(rig: art.Rig, angle: float = 1.0) -> np.ndarray:
    q = rig.neutral()
    q[rig.joints["elbow"].q_slice] = angle
    return q


class TestCommands:
    def test_a_command_of_a_target_is_that_target(self, rig, simulation):
        q = bent(rig)
        plain = simulation.run(duration=0.3, control=q)
        for control in (art.Command(q), lambda t, state: art.Command(q), lambda t, state: q):
            np.testing.assert_array_equal(simulation.run(duration=0.3, control=control).q, plain.q)

    def test_gains_are_those_of_a_pd(self, rig, simulation):
        """A command's gains do what the same gains in a PD do."""
        q, p, d = bent(rig), np.full(rig.nv, 70.0), np.full(rig.nv, 5.0)
        p[:6], d[:6] = [500.0] * 3 + [50.0] * 3, [100.0] * 3 + [10.0] * 3
        other = art.Simulation(rig, dt=0.005, actuation=art.PD(70.0, 5.0, help=HELP)).run(duration=0.3, control=q)
        for control in (art.Command(q, p, d), lambda t, state: art.Command(q, p, d)):
            np.testing.assert_allclose(simulation.run(duration=0.3, control=control).q, other.q, atol=1e-12)

    def test_limp_is_free(self, rig, simulation):
        free = art.Simulation(rig, dt=0.005, integrator="semi_implicit").run(bent(rig), duration=0.3)
        none = np.zeros(rig.nv)
        limp = simulation.run(bent(rig), duration=0.3, control=art.Command(rig.neutral(), none, none))
        np.testing.assert_allclose(limp.q, free.q, atol=1e-10)

    def test_they_change_while_it_runs(self, rig, simulation):
        q, p, d = bent(rig), np.full(rig.nv, 100.0), np.full(rig.nv, 10.0)

        def control(t, state):
            return art.Command(q, p * (t < 0.5), d * (t < 0.5))

        run = simulation.run(q, duration=1.0, control=control)
        held = run.time <= 0.5
        assert np.abs(run.tau[held][1:]).max() > 1.0
        np.testing.assert_array_equal(run.tau[run.time > 0.52], 0.0)

    def test_each_state_of_a_batch_has_its_own(self, rig, simulation):
        q, p, d = bent(rig), np.full((2, rig.nv), 30.0), np.full((2, rig.nv), 3.0)
        p[1] = d[1] = 0.0
        run = simulation.run(np.tile(q, (2, 1)), duration=0.3, control=lambda t, state: art.Command(rig.neutral(), p, d))
        alone = simulation.run(q, duration=0.3, control=lambda t, state: art.Command(rig.neutral(), p[1], d[1]))
        np.testing.assert_allclose(run.q[1], alone.q, atol=1e-12)
        assert np.abs(run.q[0] - run.q[1]).max() > 0.1

    def test_forces_besides(self, rig):
        """A drive without gains gives what it is told to."""
        fixed = art.load(rig.to_urdf())
        tau = np.array([0.3, -0.2, 0.1, 0.5])
        drives = art.Simulation(fixed, dt=0.005, limits=False, actuation=art.PD(1.0, 1.0))
        none = np.zeros(4)
        run = drives.run(duration=0.3, control=art.Command(fixed.neutral(), none, none, tau=tau))
        torques = art.Simulation(fixed, dt=0.005, limits=False, integrator="semi_implicit").run(duration=0.3, control=tau)
        np.testing.assert_allclose(run.q, torques.q, atol=1e-12)
        np.testing.assert_allclose(run.tau[1:], np.tile(tau, (len(run.time) - 1, 1)), atol=1e-12)
        np.testing.assert_allclose(run.work, torques.work, atol=1e-12)

    def test_limits_hold_for_all_of_it(self, rig, limited):
        tau = np.full(rig.nv, 50.0)
        tau[:6] = 0.0
        run = limited.run(duration=0.2, control=art.Command(bent(rig), tau=tau))
        assert np.abs(run.tau[:, 6:]).max() == pytest.approx(2.0)
        stronger = limited.run(duration=0.2, control=art.Command(bent(rig), limit=np.full(rig.nv, 5.0), tau=tau))
        assert np.abs(stronger.tau[:, 6:]).max() == pytest.approx(5.0)

    def test_steps_tell_their_time(self, rig, simulation):
        asked = []
        state = simulation.reset()
        for _ in range(3):
            state = simulation.step(state, lambda t, s: asked.append((t, s.time)) or art.Command(rig.neutral()))
        np.testing.assert_allclose(asked, [(0.0, 0.0), (0.005, 0.005), (0.01, 0.01)])
        assert state.time == pytest.approx(0.015)


class TestHelp:
    def test_it_carries(self, rig, simulation):
        """Held up against its weight, m g / k lower."""
        run = simulation.run(duration=4.0, control=rig.neutral())
        assert run.q[-1, 2] == pytest.approx(-rig.mass * 9.81 / 500.0, rel=1e-3)

    def test_it_has_its_limit(self, rig):
        weak = art.PD(30.0, 3.0, help=art.RootHelp((500.0, 50.0), (100.0, 10.0), (5.0, 5.0)))
        run = art.Simulation(rig, dt=0.005, actuation=weak).run(duration=0.5, control=rig.neutral())
        assert np.abs(run.tau[:, :3]).max() == pytest.approx(5.0)
        assert run.q[-1, 2] < -0.5

    def test_any_gain_is_stable(self, rig):
        stiff = art.PD(1e6, 1e3, help=art.RootHelp((1e8, 1e8), (1e3, 1e3)))
        run = art.Simulation(rig, dt=0.01, actuation=stiff).run(bent(rig), np.ones(rig.nv), duration=1.0, control=rig.neutral())
        assert np.abs(art.difference(rig, rig.neutral(), run.q[-1])).max() < 1e-4


class TestErrors:
    def test_commands(self, rig, simulation):
        for command, message in (
            (
                art.Command(rig.neutral(), stiffness=np.ones(3)),
                r"stiffness of a command has shape \(3,\); expected \(\.\.\., 10\)",
            ),
            (art.Command(rig.neutral(), damping=2.0), r"damping of a command has shape \(\)"),
            (
                art.Command(rig.neutral(), stiffness=-np.ones(10)),
                r"stiffness of a command holds -1\.0; expected numbers, zero or more",
            ),
            (art.Command(rig.neutral(), stiffness=np.full(10, np.nan)), "stiffness of a command holds nan"),
            (art.Command(rig.neutral(), limit=np.ones(10)), "limits drives that have no limits; give the PD a limit"),
            (art.Command(np.zeros(3)), r"control has shape \(3,\); expected"),
        ):
            with pytest.raises(ValueError, match=message):
                simulation.run(duration=0.1, control=command)
            with pytest.raises(ValueError, match=r"control|command"):
                simulation.run(duration=0.1, control=lambda t, state, command=command: command)

    def test_help(self, rig):
        with pytest.raises(ValueError, match=r"stiffness of a root's help is \(1, -1\); expected two numbers, zero or more"):
            art.RootHelp((1, -1))
        with pytest.raises(ValueError, match="damping of a root's help is 3; expected two numbers"):
            art.RootHelp((1, 1), 3)
        with pytest.raises(ValueError, match="has no free or planar root to be helped; leave help out"):
            art.Simulation(art.load(rig.to_urdf()), actuation=art.PD(1.0, help=HELP))
