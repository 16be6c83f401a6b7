"""Particles that a rig carries: one solution with the rig, against a dense one; momentum; heavy, stiff and fast ones; errors."""

from __future__ import annotations

import numpy as np
import pytest

import articulated as art
from articulated import particles as ap
from articulated.particles.roots import matrix

G = 9.81


def arm(links=3, mass=1.0):
    """A chain of hinges about changing axes, from the world down."""
    builder = art.RigBuilder("arm")
    builder.link("base")
    previous = "base"
    for k in range(links):
        builder.link(f"link{k}", mass, (0, 0, -0.15), np.eye(3) * 0.01 * mass, [art.Box((0.05, 0.05, 0.3))])
        axis = [(1, 0, 0), (0, 1, 0), (0.6, 0, 0.8)][k % 3]
        pose = np.eye(4)
        pose[2, 3] = -0.3 if k else 0.0
        builder.joint(f"joint{k}", "revolute", previous, f"link{k}", pose=pose, axis=axis)
        previous = f"link{k}"
    return builder.build()


@pytest.fixture(scope="module")
def puppet():
    """A torso with a head and two arms, free."""
    builder = art.RigBuilder("puppet")
    builder.link("torso", 20.0, (0, 0, 0.2), np.diag([0.5, 0.4, 0.2]))
    for name, mass, at, kind in (
        ("head", 4.0, (0, 0, 0.5), "ball"),
        ("left", 3.0, (0, 0.2, 0.4), "ball"),
        ("right", 3.0, (0, -0.2, 0.4), "revolute"),
    ):
        builder.link(name, mass, (0.0, 0.0, 0.1), np.eye(3) * 0.03)
        builder.joint(f"{name}_joint", kind, "torso", name, xyz=at)
    return builder.build(root="free")


def tail(link="head", mass=0.2, stiffness=1e4, particles=8, **more):
    roots = [(-0.1, 0.02 * k, 0.1) for k in range(3)]
    return ap.hair_on(link, roots, (-1.0, 0.0, 0.3), 0.3, particles, mass, stiffness, 1e-4, 0.1, **more)


def cape(*links):
    """Cloth whose upper corners hang on links."""
    cloth = ap.grid_cloth((-0.15, -0.2, 0.4), (0, 0, -0.6), (0, 0.4, 0), 6, 5, 2.0, 1e4, bending=1e-3, damping=1e-3)
    some = [[0, 1], [3, 4]] if len(links) == 2 else [[0, 1, 3, 4]]
    return ap.Attached(cloth.x, cloth.mass, cloth.forces, dict(zip(links, some, strict=True)))


LOADS = {
    "strands": lambda: [tail()],
    "cape on a link": lambda: [cape("torso")],
    "cape on two": lambda: [cape("left", "right")],
    "both": lambda: [tail(), cape("left", "right")],
}


def momentum(rig, q, state):
    """Of these velocities at the configuration where the step found them; a free root's are the same in the world."""
    v = state.v.copy()
    R_then, R_now = (art.link_poses(rig, x)[0, :3, :3] for x in (q, state.q))
    for k in (0, 3):
        v[k : k + 3] = R_then.T @ R_now @ v[k : k + 3]
    return art.momentum(rig, q, v)[:3]


@pytest.mark.parametrize("load", LOADS)
def test_momentum_of_all_is_constant(puppet, load, rng):
    some = LOADS[load]()
    simulation = art.Simulation(puppet, dt=0.005, gravity=(0, 0, 0), particles=some, limits=False)
    mass = np.concatenate([one.mass for one in some])
    for _ in range(2):
        state = simulation.reset(puppet.neutral(), rng.normal(size=puppet.nv))
        found = []
        for _ in range(25):
            new = simulation.step(state)
            found.append(momentum(puppet, state.q, new) + mass @ new.particles[:, 3:])
            state = new
        assert np.abs(found[0]).max() > 1.0
        np.testing.assert_allclose(found, np.broadcast_to(found[0], (25, 3)), rtol=0, atol=1e-10)


def test_the_ground_bears_what_hangs_on_a_rig():
    """A block on legs of rope's length, three tails hanging from its rim."""
    rig = art.loose_body(art.Box((0.4, 0.4, 0.5)), 2.0)
    roots = [(0.3, 0.0, 0.2), (-0.3, 0.1, 0.2), (-0.3, -0.1, 0.2)]
    ropes = ap.hair_on("body", roots, (0.0, 0.0, -1.0), 0.3, 7, 0.5, 1e4, damping=50.0)
    run = art.Simulation(rig, dt=0.005, ground=True, particles=ropes).run((0, 0, 0.25, 0, 0, 0, 1), duration=3.0)
    np.testing.assert_allclose(run.contact_forces[-1].sum(axis=0), (0.0, 0.0, 3.5 * G), atol=1e-3)


@pytest.mark.parametrize("load", ["strands", "cloth on one", "cloth on three", "a rope from the world"])
def test_a_step_is_that_of_one_dense_system(load, rng):
    """Everything at once, rig and particles, with the mass matrix and Jacobians: all velocities agree."""
    rig, h = arm(), 4e-3
    if load == "strands":
        some = ap.hair_on("link1", rng.normal(size=(4, 3)) * 0.1, rng.normal(size=(4, 3)), 0.3, 5, 0.3, 1e3, 1e-3, 0.3)
    elif load == "a rope from the world":
        rope = ap.rope((0.3, 0.1, 0.0), (0.0, 0.0, -0.9), 7, 0.5, 1e3, 1e-2)
        some = ap.Attached(rope.x, rope.mass, rope.forces, {"link2": [6], "base": [0]})
    else:
        cloth = ap.grid_cloth((0, 0, -0.2), (0.3, 0, 0), (0, 0.3, 0), 4, 3, 3.0, 500.0, bending=1e-2, damping=1e-3)
        roots = {"link1": [0, 2, 7]} if load == "cloth on one" else {"link2": [0, 11], "link0": [4], "link1": [8]}
        some = ap.Attached(cloth.x, cloth.mass, cloth.forces, roots)
    alone = art.Simulation(rig, dt=h, limits=False, integrator="semi_implicit")
    both = art.Simulation(rig, dt=h, limits=False, particles=some)
    for _ in range(3):
        start = both.reset(rig.random(rng), rng.normal(size=rig.nv))
        found, free = both.step(start), alone.step(alone.reset(start.q, start.v))
        expected = dense_step(rig, some, start, free.v, h)
        np.testing.assert_allclose(found.v, expected[: rig.nv], atol=1e-9 * np.abs(expected).max())
        np.testing.assert_allclose(
            found.particles[:, 3:], expected[rig.nv :].reshape(-1, 3), atol=1e-9 * np.abs(expected).max()
        )
        assert np.abs(found.v - free.v).max() > 1e-3
        if load == "a rope from the world":
            np.testing.assert_array_equal(found.particles[0], [*some.x[0], 0.0, 0.0, 0.0])


def dense_step(rig, some, start, v_free, h):
    x, v = start.particles[:, :3], start.particles[:, 3:]
    n, nv = len(x), rig.nv
    system = ap.System(x, v, some.mass, [ap.Gravity(), *some.forces])
    free = np.ones(n, dtype=bool)
    J = np.zeros((3 * n, nv + 3 * n))
    for link, numbers in some.roots.items():
        poses = art.link_poses(rig, start.q)
        X = poses[list(rig.links).index(link)]
        for k in numbers:
            free[k] = False
            J[3 * k : 3 * k + 3, :nv] = art.jacobian(rig, start.q, link, (x[k] - X[:3, 3]) @ X[:3, :3])[:3]
    for k in np.flatnonzero(free):
        J[3 * k : 3 * k + 3, nv + 3 * k : nv + 3 * k + 3] = np.eye(3)
    A = matrix(system, h, x + h * v, v, h).toarray()
    b = A @ v.ravel() + h * system.force(h, x + h * v, v).ravel()
    M = art.mass_matrix(rig, start.q)
    whole, right = J.T @ A @ J, J.T @ b
    whole[:nv, :nv] += M
    right[:nv] += M @ v_free
    keep = np.concatenate([np.ones(nv, dtype=bool), np.repeat(free, 3)])
    solution = np.zeros(nv + 3 * n)
    solution[keep] = np.linalg.solve(whole[np.ix_(keep, keep)], right[keep])
    return np.concatenate([solution[:nv], J @ solution])


def test_a_heavy_rope_is_stable():
    """Ten times as heavy as the link that it hangs on, at 5 ms."""
    rig = arm(2, mass=0.3)
    rope = ap.hair_on("link1", [(0, 0, -0.3)], (0, 0, -1), 0.6, 13, 3.0, 1e5)
    simulation = art.Simulation(rig, dt=0.005, limits=False, particles=rope)
    run = simulation.run([1.0, 0.5], duration=8.0)
    system = ap.System(rope.x, None, rope.mass, [ap.Gravity(), *rope.forces])
    energy = [run.energy[k] + system.energy(0.0, run.particles.x[k], run.particles.v[k]) for k in range(len(run.time))]
    energy = np.array(energy)
    size = energy[0] - energy.min()
    assert np.isfinite(run.q).all()
    assert energy.max() < energy[0] + 0.02 * size
    assert energy[-1] < energy[0]
    last = run.particles.x[-100:]
    length = np.linalg.norm(np.diff(last, axis=1), axis=2).sum(axis=1)
    np.testing.assert_allclose(length, 0.6, rtol=0.01)


@pytest.mark.sweep
def test_an_over_stiff_ponytail_on_a_head_that_shakes():
    """For 60 s at 5 Hz, to and fro by 10 cm, at 10 ms."""
    builder = art.RigBuilder("shaker")
    builder.link("base")
    builder.link("head", 4.0, inertia=np.eye(3) * 0.02, collisions=[art.Sphere(0.1)])
    builder.joint("shake", "prismatic", "base", "head", axis=(0, 1, 0))
    rig = builder.build()
    hair = ap.hair_on("head", [(-0.1, 0, 0)], (-1, 0, 0), 0.4, 12, 0.1, 1e8, bending=1e-3)
    drive = art.PD(stiffness=1e5, damping=1e3)
    simulation = art.Simulation(rig, dt=0.01, actuation=drive, particles=hair)
    run = simulation.run(duration=60.0, control=lambda t, state: np.array([0.1 * np.sin(2 * np.pi * 5.0 * t)]))
    assert np.abs(run.q).max() == pytest.approx(0.1, abs=0.03)
    assert np.isfinite(run.particles.x).all()
    assert np.linalg.norm(run.particles.v, axis=-1).max() < 100.0
    reach = np.linalg.norm(run.particles.x - run.particles.x[:, :1], axis=-1)
    assert reach.max() < 0.42


def test_batches_and_machine_code(puppet, rng, monkeypatch):
    """A state's bits do not depend on its company, and machine code does what the interpreter does."""
    simulation = art.Simulation(puppet, dt=0.005, particles=LOADS["both"](), limits=False)
    v = rng.normal(size=(3, puppet.nv))
    many = simulation.run(puppet.neutral(), v, duration=0.1, fps=20.0)
    assert many.particles.x.shape == (3, 3, 54, 3)
    one = simulation.run(puppet.neutral(), v[1], duration=0.1, fps=20.0)
    assert one.q.tobytes() == many.q[1].tobytes()
    assert one.particles.x.tobytes() == many.state(1).particles.x.tobytes()
    monkeypatch.setenv("ARTICULATED_INTERPRET", "1")
    other = simulation.run(puppet.neutral(), v[1], duration=0.1, fps=20.0)
    np.testing.assert_allclose(other.q, one.q, atol=1e-12)
    np.testing.assert_allclose(other.particles.x, one.particles.x, atol=1e-11)


def test_float32(puppet, rng):
    """The rig's part; particles stay what they are."""
    simulation = art.Simulation(puppet, dt=0.005, particles=tail())
    v = rng.normal(size=puppet.nv)
    wide = simulation.run(puppet.neutral(), v, duration=0.2, fps=20.0)
    run = simulation.run(puppet.neutral().astype(np.float32), v.astype(np.float32), duration=0.2, fps=20.0)
    assert run.q.dtype == np.float32 or np.abs(run.q - wide.q).max() > 0.0
    np.testing.assert_allclose(run.q, wide.q, atol=1e-3)
    np.testing.assert_allclose(run.particles.x, wide.particles.x, atol=1e-3)


def test_steps_go_on_where_runs_do(puppet, rng):
    simulation = art.Simulation(puppet, dt=0.005, particles=tail(), substeps=2)
    v = rng.normal(size=(2, puppet.nv))
    run = simulation.run(puppet.neutral(), v, duration=0.05, fps=100.0)
    state = simulation.reset(puppet.neutral(), v)
    np.testing.assert_array_equal(state.particles[..., :3], run.particles.x[:, 0])
    for _ in range(5):
        state = simulation.step(state)
    np.testing.assert_array_equal(state.particles[..., :3], run.particles.x[:, -1])
    again = simulation.reset(puppet.neutral(), v, state, where=[True, False])
    np.testing.assert_array_equal(again.particles[0, :, :3], run.particles.x[0, 0])
    np.testing.assert_array_equal(again.particles[1], state.particles[1])


def test_they_start_where_links_take_them(puppet, rng):
    q, v = puppet.random(rng), rng.normal(size=puppet.nv)
    hair = tail()
    state = art.Simulation(puppet, particles=hair).reset(q, v)
    X = art.link_poses(puppet, q)[list(puppet.links).index("head")]
    np.testing.assert_allclose(state.particles[:, :3], hair.x @ X[:3, :3].T + X[:3, 3], atol=1e-14)
    h = 1e-6
    after = art.link_poses(puppet, art.integrate(puppet, q, h * v))[list(puppet.links).index("head")]
    moved = hair.x @ after[:3, :3].T + after[:3, 3]
    np.testing.assert_allclose(state.particles[:, 3:], (moved - state.particles[:, :3]) / h, atol=1e-4)


@pytest.mark.parametrize("shape", [art.Sphere(0.1), art.Box((0.2, 0.16, 0.2)), art.Capsule(0.06, 0.1), art.Cylinder(0.1, 0.2)])
def test_hair_stays_out_of_what_it_avoids(shape):
    """Which falls down over a head that turns."""
    builder = art.RigBuilder("head")
    builder.link("base")
    builder.link("head", 3.0, inertia=np.eye(3) * 0.02, collisions=[shape])
    builder.joint("nod", "revolute", "base", "head", axis=(1, 0, 0))
    rig = builder.build()
    hair = ap.hair_on("head", [(0.01, 0.0, 0.11), (0.0, 0.02, 0.11)], (0, 0, 1), 0.3, 10, 0.02, 1e4, 1e-6, 0.1, avoids=["head"])
    run = art.Simulation(rig, dt=0.005, particles=hair).run(v0=[2.0], duration=1.0)
    from articulated.particles.points import vectors
    from articulated.simulation.freight import collider_of

    collider, nearest = collider_of(shape, "head", 0.0, 0.0), np.inf
    for x, X in zip(run.particles.x, art.link_poses(rig, run.q)[:, rig.links["head"].index], strict=True):
        local = (np.delete(x, [0, 10], axis=0) - X[:3, 3]) @ X[:3, :3]
        nearest = min(nearest, collider.gap(0.0, vectors(local))[0].min())
    assert -1e-7 < nearest < 0.001


def test_loose_particles_fall_on_links_that_move(rng):
    """Cloth on a ball that is pushed along a rail, and snow; the ball does not feel it."""
    builder = art.RigBuilder("pusher")
    builder.link("base")
    builder.link("ball", 2.0, inertia=np.eye(3) * 0.02, collisions=[art.Sphere(0.2)])
    builder.joint("rail", "prismatic", "base", "ball", axis=(1, 0, 0))
    rig = builder.build()
    cloth = ap.grid_cloth((-0.35, -0.35, 0.3), (0.7, 0, 0), (0, 0.7, 0), 12, 12, 0.3, 300.0, damping=2e-3)
    snow = rng.uniform((-0.3, -0.3, 0.4), (1.0, 0.3, 0.9), (60, 3))
    things = [
        ap.Attached(cloth.x, cloth.mass, cloth.forces, avoids="ball", friction=0.8),
        ap.Attached(snow, 1e-3, [ap.Drag(1e-3)], avoids=["ball"]),
    ]
    simulation = art.Simulation(rig, dt=0.005, particles=things, ground=art.Ground(art.Plane((0, 0, 1), (0, 0, -0.5))))
    run = simulation.run(v0=[0.5], duration=1.2, fps=50)
    np.testing.assert_allclose(run.q[:, 0], 0.5 * run.time, atol=1e-9)
    start = run.particles.x[0]
    np.testing.assert_array_equal(start, np.concatenate([cloth.x, snow]))
    middle = np.stack([run.q[:, 0], 0 * run.time, 0 * run.time], axis=1)
    distance = np.linalg.norm(run.particles.x - middle[:, None], axis=2)
    assert distance.min() > 0.2 - 1e-9
    lying = distance[-1, : len(cloth.x)] < 0.21
    assert lying.mean() > 0.2
    assert run.particles.x[-1, : len(cloth.x)][lying, 0].mean() > 0.3  # it was taken along
    assert run.particles.x[..., 2].min() > -0.5 - 1e-9
    hit = (distance[:, len(cloth.x) :] < 0.201).any(axis=0)
    assert 0.02 < hit.mean() < 0.9


GROUNDS = {
    "plane": art.Ground(art.Plane((0.2, 0.0, 1.0)), friction=0.4),
    "hills": art.Ground(
        art.HeightField(0.1 * np.sin(np.arange(60.0)).reshape(6, 10).cumsum(axis=0), (0.4, 0.4), (-2.0, -1.0, 0.0))
    ),
    "stairs": art.Ground(art.Stairs(0.15, 0.3, 4, (-0.5, 0.0, 0.0), 0.3)),
}


@pytest.mark.parametrize("ground", GROUNDS)
def test_particles_lie_on_the_ground_of_the_rig(ground):
    rig = art.loose_body(art.Sphere(0.1), 1.0)
    rope = ap.hair_on("body", [(0.0, 0.0, 0.1), (0.1, 0.0, 0.0)], [(1, 1, 0), (-1, 0, 0)], 0.8, 9, 0.1, 1e4, 1e-4, 1.0)
    simulation = art.Simulation(rig, dt=0.005, ground=GROUNDS[ground], particles=rope)
    run = simulation.run((0, 0, 1.5, 0, 0, 0, 1), duration=1.5, fps=20)
    from articulated.particles.points import vectors

    colliders = simulation._world.freight.lots[0].system.colliders
    x = np.delete(run.particles.x, [0, 9], axis=1)
    gaps = np.array([[collider.gap(0.0, vectors(frame))[0] for collider in colliders] for frame in x])
    nearest = gaps.min(axis=1)
    assert nearest.min() > -1e-4
    assert (nearest[-1] < 1e-3).mean() > 0.5
    deepest = -run.contact_gaps[-1].min()
    assert deepest < 3e-3  # it rolls


class TestErrors:
    def test_attached(self):
        x = np.zeros((3, 3)) + np.arange(3)[:, None]
        springs = [ap.Springs([(0, 1), (1, 2)], 1.0)]

        def wrong(match, **changes):
            given = {"x": x, "mass": 1.0, "forces": springs, "roots": {"head": [0]}} | changes
            with pytest.raises(ValueError, match=match):
                ap.Attached(**given)

        wrong(r"roots is \[0\]", roots=[0])
        wrong(r"roots\['head'\] is empty", roots={"head": []})
        wrong("there are 3 particles", roots={"head": [3]})
        wrong("particle 1 is a root twice", roots={"head": [0, 1], "torso": [1]})
        wrong("Gravity", forces=[ap.Gravity()])
        wrong("has weight", mass=[1.0, 0.0, 1.0])
        wrong("friction is -1", friction=-1.0)
        wrong("there are 3 particles", forces=[ap.Springs([(0, 3)], 1.0)])

    def test_hair(self):
        def wrong(match, **changes):
            given = {
                "link": "head",
                "roots": [(0, 0, 0)],
                "directions": (0, 0, 1),
                "length": 1.0,
                "particles": 5,
                "mass": 1.0,
                "stiffness": 1.0,
            }
            with pytest.raises(ValueError, match=match):
                ap.hair_on(**(given | changes))

        wrong("no roots", roots=np.zeros((0, 3)))
        wrong(r"directions\[0\] is the zero vector", directions=(0, 0, 0))
        wrong("length", length=0.0)
        wrong("mass", mass=[1.0, 2.0])
        wrong("particles is 1", particles=1)
        wrong("stiffness is 0", stiffness=0.0)
        wrong("give drag", wind=(1, 0, 0))

    def test_simulation(self, puppet):
        with pytest.raises(ValueError, match="has no link 'hat'"):
            art.Simulation(puppet, particles=tail("hat"))
        with pytest.raises(ValueError, match=r"expected particles\.Attached"):
            art.Simulation(puppet, particles=[ap.Gravity()])
        with pytest.raises(ValueError, match="expected semi_implicit"):
            art.Simulation(puppet, particles=tail(), integrator="rk4")
        with pytest.raises(ValueError, match=r"a System of their own"):
            art.Simulation(arm(), particles=tail("base"))
        with pytest.raises(ValueError, match="no collision shape"):
            art.Simulation(arm(), particles=tail("link1", avoids=["base"]))
