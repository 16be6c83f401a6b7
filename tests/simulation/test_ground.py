"""Ground of other shapes, points of contact of all collision shapes, bad input, and batches as learners use them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from contact_rigs import body, on_incline, rig_of, upright

import articulated as art


@pytest.fixture(scope="module")
def ball() -> art.Rig:
    return body(art.Sphere(0.1), [0.004] * 3)


@pytest.fixture(scope="module")
def box() -> art.Rig:
    return body(art.Box((0.2, 0.2, 0.2)), [1 / 150] * 3)


class TestSurfaces:
    def test_a_field_that_is_a_plane(self, ball):
        plane, q = on_incline(ball, 0.2, 0.1)
        x = np.linspace(-3.0, 3.0, 61)
        field = art.HeightField(np.tile(math.tan(0.2) * x, (61, 1)), 0.1, (-3.0, -3.0, 0.0))
        runs = [
            art.Simulation(ball, ground=art.Ground(s, friction=0.3), tolerance=1e-10).run(q, duration=0.5)
            for s in (plane, field)
        ]
        np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-9)
        np.testing.assert_allclose(runs[1].contact_normals, runs[0].contact_normals, atol=1e-12)

    def test_a_bowl(self, ball):
        """Balls roll down, and energy is what friction leaves."""
        x = np.linspace(-2.0, 2.0, 81)
        field = art.HeightField(0.1 * (x[:, None] ** 2 + x**2), 0.05, (-2.0, -2.0, 0.0))
        q = upright(ball, 0.5, (5,))
        q[:, 0] = np.linspace(-1.0, 1.0, 5)
        run = art.Simulation(ball, ground=art.Ground(field)).run(q, duration=2.0)
        assert run.report
        assert (np.linalg.norm(run.q[:, :, :2], axis=-1) < 1.05).all()
        assert np.abs(run.q[2, -1, :2]).max() < 0.05  # the one in the middle stays there

    def test_new_heights_need_no_compiling(self, ball, monkeypatch):
        ground = [art.Ground(art.HeightField(np.full((3, 3), z), 1.0, (-1.0, -1.0, 0.0))) for z in (0.0, 0.3)]
        ends = [art.Simulation(ball, ground=ground[0]).run(upright(ball, 0.6), duration=1.0).q[-1, 2]]
        monkeypatch.setattr("articulated.compiler.kernels._build", None)
        ends.append(art.Simulation(ball, ground=ground[1]).run(upright(ball, 0.6), duration=1.0).q[-1, 2])
        assert ends == pytest.approx([0.0995, 0.3995], abs=1e-4)

    def test_beyond_the_edge_it_goes_on(self, ball):
        field = art.HeightField([[0.0, 0.2], [0.0, 0.2]], 1.0, (0.0, -0.5, 0.0))
        q = upright(ball, 0.4, (2,))
        q[:, 0] = [-5.0, 5.0]
        run = art.Simulation(ball, ground=art.Ground(field)).run(q, duration=1.0)
        assert run.q[:, -1, 2] == pytest.approx([0.0995, 0.2995], abs=1e-4)

    def test_interpreted_is_compiled(self, ball, monkeypatch):
        field = art.HeightField(np.random.default_rng(0).uniform(0.0, 0.1, (9, 9)), 0.25, (-1.0, -1.0, 0.0))
        simulation = art.Simulation(ball, ground=art.Ground([field, art.Plane((1.0, 0.0, 0.0), (-0.5, 0.0, 0.0))]))
        compiled = simulation.run(upright(ball, 0.3), duration=0.4)
        monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
        interpreted = simulation.run(upright(ball, 0.3), duration=0.4)
        np.testing.assert_allclose(interpreted.q, compiled.q, atol=1e-12)

    def test_stairs(self, box):
        """Boxes stand on steps, on the floor before them and on the landing, whichever way they lead."""
        for heading in (0.0, 2.0):
            up = np.array([math.cos(heading), math.sin(heading)])
            stairs = art.Stairs(0.15, 0.3, 4, (1.0, 2.0, 0.5), heading)
            q = upright(box, 1.7, (4,))
            along = np.array([-1.0, 0.15, 0.45, 3.0])
            q[:, :2] = np.array([1.0, 2.0]) + along[:, None] * up
            q[:, 5:] = math.sin(0.5 * heading), math.cos(0.5 * heading)
            run = art.Simulation(box, ground=art.Ground(stairs)).run(q, duration=1.5)
            assert run.q[:, -1, 2] == pytest.approx([0.6, 0.75, 0.90, 1.20], abs=1e-3)
            np.testing.assert_allclose(run.q[:, -1, :2], q[:, :2], atol=1e-4)

    def test_distance_from_stairs(self, ball):
        """The nearest of all steps, from anywhere outside, and which way that is."""
        rng, (rise, run, count) = np.random.default_rng(0), (0.17, 0.29, 5)
        x, z = rng.uniform(-1.0, 2.0, 4000), rng.uniform(0.0, 1.5, 4000)
        out = z > rise * np.clip(np.floor(x / run) + 1.0, 0, count)
        q = upright(ball, 0.0, (int(out.sum()),))
        q[:, 0], q[:, 2] = x[out], z[out]
        k = np.arange(count)
        before, above = np.maximum(run * k - q[:, 0, None], 0.0), np.maximum(q[:, 2, None] - rise * (k + 1), 0.0)
        distance = np.minimum(np.hypot(before, above).min(axis=1), q[:, 2])
        simulation = art.Simulation(ball, ground=art.Ground(art.Stairs(rise, run, count)))
        contacts = simulation.contacts(simulation.reset(q))
        near = distance < min(rise, run)  # all that a ball of that radius could meet
        np.testing.assert_allclose(contacts.gaps.min(axis=1)[near], distance[near] - 0.1, atol=1e-12)
        assert near.sum() > 500
        foot = contacts.points + contacts.gaps[..., None] * -contacts.normals  # on the steps
        np.testing.assert_allclose(np.linalg.norm(foot - q[:, None, :3], axis=-1), contacts.gaps + 0.1, atol=1e-9)

    def test_a_ragdoll_comes_to_rest_on_stairs(self):
        rig = art.load("ragdoll", root="free")
        stairs = art.Stairs(0.17, 0.29, 8, start=(2.32, 0.0, -1.36), heading=math.pi)
        ground, drives = art.Ground(stairs, friction=0.6), art.PD(stiffness=15.0, damping=3.0)
        q, v = upright(rig, 1.05, (16,)), np.zeros((16, rig.nv))
        q[:, 0], v[:, 0] = -0.6, np.linspace(1.1, 2.1, 16)
        run = art.Simulation(rig, ground=ground, actuation=drives).run(q, v, duration=6.0, control=rig.neutral())
        assert np.abs(run.v[:, -30:]).max() < 0.01
        assert (run.q[:, -1, 2] < 0.3).all()  # down some of them

    def test_terrain_is_smooth(self, ball):
        """Normals of a rough field do not jump, though its heights do."""
        field = art.HeightField(np.random.default_rng(0).uniform(0.0, 0.05, (9, 9)), 0.25, (-1.0, -1.0, 0.0))
        q = upright(ball, 0.3, (4001,))
        q[:, 0] = np.linspace(-1.2, 1.2, 4001)
        simulation = art.Simulation(ball, ground=art.Ground(field))
        contacts = simulation.contacts(simulation.reset(q))
        assert np.abs(np.diff(contacts.normals[:, 0], axis=0)).max() < 2e-3
        assert np.abs(np.diff(contacts.gaps[:, 0])).max() < 5e-4

    def test_image(self, tmp_path, ball):
        from PIL import Image

        Image.fromarray(np.array([[255, 255], [0, 0]], dtype=np.uint8)).save(tmp_path / "slope.png")
        field = art.HeightField.from_image(tmp_path / "slope.png", (2.0, 2.0), 0.5)
        np.testing.assert_allclose(field.heights, [[0.0, 0.0], [0.5, 0.5]])  # the top of the image towards +y
        (tmp_path / "not.png").write_text("not an image")
        with pytest.raises(ValueError, match=r"not.png is not an image that can be read"):
            art.HeightField.from_image(tmp_path / "not.png", (1.0, 1.0), 1.0)

    def test_a_corner_of_two_planes(self, ball):
        """A ball in a V leans on both."""
        v = [art.Plane((1.0, 0.0, 1.0)), art.Plane((-1.0, 0.0, 1.0))]
        q = upright(ball, 0.2)
        run = art.Simulation(ball, ground=art.Ground(v, friction=0.0)).run(q, duration=1.0)
        assert run.q[-1, 2] == pytest.approx(0.1 * math.sqrt(2.0), abs=1e-3)
        assert (np.linalg.norm(run.contact_forces[-1], axis=-1) > 1.0).all()

    def test_start_deep_inside(self, box):
        """Pushed out slowly, and told of."""
        run = art.Simulation(box, ground=True).run(upright(box, -0.2), duration=5.0)
        assert run.v[:, 2].max() < 0.12
        assert run.q[-1, 2] == pytest.approx(0.1, abs=1e-3)
        assert run.report["penetration"].value == pytest.approx(0.3, abs=1e-6)
        assert not run.report


class TestShapes:
    def test_all_kinds(self):
        """Capsule and box rest on what is lowest of them."""
        for shape, height in ((art.Capsule(0.1, 0.4), 0.1), (art.Box((0.3, 0.2, 0.1)), 0.05), (art.Cylinder(0.1, 0.06), 0.03)):
            rig = body(shape, [0.01] * 3)
            q = upright(rig, height + 0.1)
            if isinstance(shape, art.Capsule):
                q[3:] = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]
            run = art.Simulation(rig, ground=True).run(q, duration=1.0)
            assert run.q[-1, 2] == pytest.approx(height, abs=6e-4)

    def test_mesh(self, tmp_path):
        import trimesh

        trimesh.creation.box((0.2, 0.3, 0.4)).export(tmp_path / "box.stl")
        urdf = """<robot name="m"><link name="a"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
            </inertial><collision><geometry><mesh filename="box.stl" scale="1 1 0.5"/></geometry></collision></link></robot>"""
        (tmp_path / "m.urdf").write_text(urdf)
        rig = art.load(tmp_path / "m.urdf", root="free")
        simulation = art.Simulation(rig, ground=True)
        corners = np.abs(simulation.contacts(simulation.reset()).points)
        np.testing.assert_allclose(corners, np.tile([0.1, 0.15, 0.1], (6, 1)), atol=1e-7)
        (tmp_path / "box.stl").write_text("solid nonsense")
        with pytest.raises(ValueError, match=r"box.stl: this mesh cannot be read .*, or give other shapes"):
            art.Simulation(art.load(tmp_path / "m.urdf", root="free"), ground=True)

    def test_links_by_name(self):
        rig = art.load("ragdoll", root="free")
        simulation = art.Simulation(rig, ground=True, contact_points=["left_foot", art.ContactPoint("head", (0.0, 0.0, 0.1))])
        assert set(simulation.contacts(simulation.reset()).links) == {"left_foot", "head"}


class TestBadInput:
    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: art.Ground(friction=-0.1), r"friction is -0.1; expected a number, zero or more"),
            (lambda: art.Ground(restitution=1.5), r"restitution is 1.5; expected a number from 0 to 1"),
            (lambda: art.Ground(stiffness=0.0), r"stiffness is 0.0; expected a positive number of N/m, or None"),
            (lambda: art.Ground(dissipation=math.nan), r"dissipation is nan; expected a number of s/m, zero or more"),
            (lambda: art.Ground(velocity=(1.0, 2.0)), r"velocity is \(1.0, 2.0\); expected three numbers"),
            (lambda: art.Ground("floor"), r"surfaces holds 'f'; expected planes, height fields and stairs"),
            (lambda: art.Ground([]), r"surfaces is empty; expected at least one surface, or no ground at all"),
            (lambda: art.Ground(materials={"a": 0.5}), r"the material of link 'a' is 0.5; expected a Material"),
            (lambda: art.Plane((0, 0, 0)), r"normal of a plane is the zero vector; expected a direction, out of the ground"),
            (lambda: art.Plane((0, 0, math.nan)), r"normal is \(0, 0, nan\); every entry must be finite"),
            (
                lambda: art.HeightField([[0.0, math.nan], [0.0, 0.0]], 1.0),
                r"heights\[0, 1\] is nan; every entry must be finite",
            ),
            (
                lambda: art.HeightField([1.0, 2.0], 1.0),
                r"heights has shape \(2,\); expected two axes, of two or more points each",
            ),
            (lambda: art.HeightField([[0, 0], [0, 0]], -1.0), r"spacing is -1.0; expected two positive numbers, along x and y"),
            (lambda: art.Stairs(-0.1, 0.3, 4), r"rise is -0.1; expected a positive number \[m\]"),
            (lambda: art.Stairs(0.1, math.inf, 4), r"run is inf; expected a positive number \[m\]"),
            (lambda: art.Stairs(0.1, 0.3, 0), r"count is 0; expected a number of steps, 1 or more"),
            (lambda: art.Stops(restitution=2.0), r"restitution of stops is 2.0; expected a number from 0 to 1"),
        ],
    )
    def test_descriptions(self, make, message):
        with pytest.raises(ValueError, match=message):
            make()

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"ground": "floor"}, r"ground is 'floor'; expected a Ground, True or None"),
            ({"ground": art.Ground(materials={"foot": art.Material()})}, r"rig 'box' has no link 'foot'"),
            ({"ground": True, "contact_points": ["foot"]}, r"rig 'box' has no link 'foot'"),
            (
                {"ground": True, "contact_points": "body"},
                r"contact_points is 'body'; expected a list of points and names of links",
            ),
            ({"ground": True, "contact_points": [3]}, r"contact_points holds 3; expected ContactPoint"),
            (
                {"ground": True, "contact_points": [art.ContactPoint("body", (0, 0, 0), -1.0)]},
                r"expected three finite numbers, and a radius",
            ),
            ({"limits": 3}, r"limits is 3; expected True, False or Stops"),
            ({"actuation": 3}, r"actuation is 3; expected a PD or None"),
            ({"actuation": art.PD([1.0, 2.0])}, r"stiffness has shape \(2,\); expected \(..., 6\) for rig 'box'"),
            ({"actuation": art.PD(np.ones(6))}, r"stiffness drives a floating or planar joint, which no motor does"),
            ({"actuation": art.PD({"knee": 1.0})}, r"stiffness: rig 'box' has no moving joint 'knee'"),
            ({"actuation": art.PD(-np.ones(6))}, r"stiffness holds -1.0; expected finite numbers, zero or more"),
            ({"dt": 0.0}, r"dt is 0.0; expected a positive number"),
            ({"tolerance": math.nan}, r"tolerance is nan; expected a positive number"),
        ],
    )
    def test_simulations(self, box, settings, message):
        with pytest.raises(ValueError, match=message):
            art.Simulation(box, **settings)

    def test_a_rig_without_shapes(self):
        builder = art.RigBuilder("ghost")
        builder.link("a", 1.0, (0, 0, 0), np.eye(3))
        with pytest.warns(art.RigWarning, match=r"rig 'ghost' has no collision shape on a link that moves: it falls through"):
            run = art.Simulation(builder.build("free"), ground=True).run(duration=0.5)
        assert run.q[-1, 2] < -1.0

    def test_a_drive_needs_a_target_in_a_step(self):
        rig = art.load("ragdoll", root="free")
        simulation = art.Simulation(rig, actuation=art.PD(10.0))
        with pytest.raises(ValueError, match=r"control is None; with actuation, give the configuration"):
            simulation.step(simulation.reset())
        with pytest.raises(ValueError, match=r"control has shape \(3,\); expected"):
            simulation.step(simulation.reset(), np.zeros(3))

    @pytest.mark.parametrize("dt", [1e-6, 0.1, 3.0])
    def test_absurd_steps_end_well(self, box, dt):
        simulation = art.Simulation(box, dt=dt, ground=True)
        state = simulation.reset(upright(box, 0.15), [0.0, 0.0, -1.0, 3.0, 0.0, 0.0])
        for _ in range(50):
            state = simulation.step(state)
        assert np.isfinite(state.q).all()
        assert np.abs(state.v).max() < 100.0

    def test_partial_reset(self, box):
        simulation = art.Simulation(box, ground=True)
        state = simulation.reset(upright(box, 0.1, (3,)))
        with pytest.raises(ValueError, match=r"where holds int64, shape \(3,\); expected booleans, shape \(3,\)"):
            simulation.reset(state=state, where=[0, 1, 2])
        with pytest.raises(ValueError, match=r"where holds bool, shape \(2,\); expected booleans, shape \(3,\)"):
            simulation.reset(state=state, where=[True, False])


class TestBatches:
    @pytest.mark.parametrize("dtype", [np.float64, np.float32])
    def test_an_environment_of_many(self, dtype):
        """What a learner does: step a batch, look at it, begin anew those that fell; no state is touched by Python alone."""
        rig = art.load("ragdoll", root="free")
        drives = art.PD(stiffness=30.0, damping=3.0, limit=150.0)
        simulation = art.Simulation(rig, ground=True, actuation=drives, substeps=5)
        rng, count = np.random.default_rng(0), 64
        start, rest = upright(rig, 1.05, (count,)).astype(dtype), np.zeros((count, rig.nv), dtype)
        state, falls, reward = simulation.reset(start, rest), 0, np.zeros(count)
        for _ in range(100):
            action = start.copy()
            action[:, rig.joints["left_knee"].q_slice] += 0.3 * rng.normal(size=(count, 1))
            state = simulation.step(state, action)
            contacts = simulation.contacts(state)
            reward += contacts.on("left_foot")[:, 2] > 0.0
            fallen = state.q[:, 2] < 0.85
            falls += fallen.sum()
            state = simulation.reset(start, rest, state, where=fallen)
            assert np.isfinite(state.q).all()
            assert state.q.dtype == state.v.dtype == dtype
            np.testing.assert_array_equal(state.q[fallen], start[fallen])
        assert falls > 0
        assert reward.max() > 5

    def test_bits(self):
        """The same for any batch, place in it, width of registers and number of threads; states end their steps at different sweeps."""
        rig = rig_of("solo12")
        links = [link.name for link in rig.links.values() if link.body >= 0 and link.mass > 0]
        points = [art.ContactPoint(name, (0.0, 0.0, -0.08)) for name in links]
        simulation = art.Simulation(rig, ground=art.Ground(restitution=0.3), contact_points=points)
        rng = np.random.default_rng(2)
        q, v = rig.random(rng, 37), rng.normal(size=(37, rig.nv))
        q[:, 2] = 0.3
        whole = simulation.run(q, v, 0.3, 50)
        assert len({*simulation_sweeps(simulation, q, v)}) > 5
        for part in (slice(0, 1), slice(5, 6), slice(3, 20), slice(11, 37)):
            some = simulation.run(q[part], v[part], 0.3, 50)
            assert some.q.tobytes() == whole.q[part].tobytes()
            assert some.contact_forces.tobytes() == whole.contact_forces[part].tobytes()
        two = art.Simulation(rig, ground=art.Ground(restitution=0.3), contact_points=points, threads=2).run(q, v, 0.3, 50)
        assert two.q.tobytes() == whole.q.tobytes()

    def test_stepping_is_running(self):
        rig = art.load("ragdoll", root="free").with_joints(friction=0.1)
        simulation = art.Simulation(rig, ground=True, dt=0.002)
        q = upright(rig, 1.0, (3,))
        run = simulation.run(q, duration=0.2, fps=500)
        state = simulation.reset(q)
        for k in range(1, 101):
            state = simulation.step(state)
            assert state.q.tobytes() == run.q[:, k].tobytes()
        np.testing.assert_array_equal(simulation.contacts(state).forces, run.contact_forces[:, -1])


def simulation_sweeps(simulation, q, v):
    state = simulation.reset(q, v)
    for _ in range(60):
        state = simulation.step(state)
    return state.memory[:, -1].tolist()
