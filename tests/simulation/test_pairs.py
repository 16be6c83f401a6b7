"""Bodies that touch each other: closed forms, stacks, impacts, momentum."""

from __future__ import annotations

import numpy as np
import pytest
from pair_rigs import boxes, free, loose, put
from scipy.spatial.transform import Rotation

import articulated as art


def places(run):
    """Where the parts of a forest are, shape (parts, frames, 3)."""
    return np.array([run.q[:, joint.q_slice][:, :3] for joint in free(run.rig)])


def acceleration(run, x, first=5):
    return 2.0 * np.polyfit(run.time[first:], x[first:], 2)[0]


def total_momentum(rig, q, v):
    """Linear, and angular about the world's origin."""
    X, V, total = art.link_poses(rig, q), art.link_velocities(rig, q, v), np.zeros(6)
    for link in rig.links.values():
        R, velocity = X[link.index, :3, :3], V[link.index]
        center = R @ link.center + X[link.index, :3, 3]
        p = link.mass * (velocity[:3] + np.cross(velocity[3:], R @ link.center))
        total += [*p, *(np.cross(center, p) + R @ link.inertia @ R.T @ velocity[3:])]
    return total


def before(rig, q, v, h=0.002):
    """The configuration at which a step found its velocities, and these there; a free root's are the same in the world."""
    q_old, v_old = art.integrate(rig, q, -h * v), v.copy()
    X_old, X = art.link_poses(rig, q_old), art.link_poses(rig, q)
    for joint in free(rig):
        k, s, at = rig.links[joint.child].index, joint.v_slice.start, joint.q_slice.start
        v_old[s : s + 3] = X_old[k, :3, :3].T @ X[k, :3, :3] @ v[s : s + 3]
        q_old[at : at + 3] = q[at : at + 3] - h * X[k, :3, :3] @ v[s : s + 3]  # straight
    return q_old, v_old


class TestRest:
    def test_a_stack_of_five(self):
        """60 s: no drift, next to no depth, at near-rigid stiffness."""
        rig = boxes(5)
        q = rig.neutral()
        rng = np.random.default_rng(3)
        for k in range(5):
            put(rig, q, k, (*rng.normal(scale=0.005, size=2), 0.1 + 0.2 * k), Rotation.from_euler("z", 0.2 * rng.normal()))
        hard = {"stiffness": 1e9}
        run = art.Simulation(rig, ground=art.Ground(**hard), collisions=art.Collisions(**hard)).run(q, duration=60.0, fps=5)
        where = places(run)[:, 5:]
        assert np.abs(where - where[:, :1]).max() < 1e-4
        assert run.contact_gaps[5:].min() > -5e-5
        assert np.abs(run.v[5:]).max() < 1e-4
        on_each = run.contact_forces[-1, 40:, 2]  # the ground's 8 corners of each box come first
        held = dict(zip(zip(run.contact_links[40:], run.contact_others[40:], strict=True), on_each, strict=True))
        for k in range(1, 5):
            below, above = f"box{k - 1}/body", f"box{k}/body"
            assert abs(held[below, above]) == pytest.approx((5 - k) * 9.81, rel=1e-3)

    def test_a_heavy_box_on_top(self):
        """A hundred times as heavy as those below."""
        rig = art.compose(**{f"box{k}": loose(art.Box((0.2, 0.2, 0.2)), m) for k, m in enumerate([1, 1, 1, 1, 100])})
        q = rig.neutral()
        for k in range(5):
            put(rig, q, k, (0.004 * (-1) ** k, 0.0, 0.1 + 0.2 * k))
        hard = {"stiffness": 1e9}
        run = art.Simulation(rig, ground=art.Ground(**hard), collisions=art.Collisions(**hard)).run(q, duration=20.0, fps=5)
        where = places(run)[:, 5:]
        assert np.abs(where - where[:, :1]).max() < 5e-4
        assert np.abs(where[:, -1] - where[:, -25]).max() < 1e-5  # nor does it creep
        assert run.q[-1, 30] > 0.898

    def test_a_house_of_two_boards(self):
        length, thick, lean = 1.0, 0.04, np.radians(20.0)
        rig = art.compose(**{f"board{k}": loose(art.Box((thick, 0.5, length)), 2.0) for k in range(2)})
        q = rig.neutral()
        for k, side in enumerate((-1.0, 1.0)):
            x = side * (0.5 * length * np.sin(lean) + 0.5 * thick * np.cos(lean))
            z = 0.5 * length * np.cos(lean) + 0.5 * thick * np.sin(lean)
            put(rig, q, k, (x, 0.0, z), Rotation.from_euler("y", -side * lean))
        ground = art.Ground(friction=0.6)
        run = art.Simulation(rig, ground=ground, collisions=art.Collisions(friction=0.6)).run(q, duration=10.0, fps=10)
        where = places(run)[:, 10:]
        assert np.abs(where - where[:, :1]).max() < 1e-5
        slippery = art.Simulation(rig, ground=art.Ground(friction=0.1), collisions=art.Collisions(friction=0.6))
        assert places(slippery.run(q, duration=2.0, fps=10))[0, -1, 2] < 0.1  # it fell flat

    @pytest.mark.sweep
    def test_a_wall_of_ten_boxes(self):
        rig = art.compose(**{f"box{k}": loose(art.Box((0.4, 0.2, 0.2)), 1.0) for k in range(10)})
        q, k = rig.neutral(), 0
        for row, count in enumerate((4, 3, 2, 1)):
            for i in range(count):
                put(rig, q, k, (0.41 * (i - 0.5 * (count - 1)), 0.0, 0.1 + 0.2 * row))
                k += 1
        near = [(f"box{a}/body", f"box{b}/body") for a, b in NEXT_IN_WALL]
        run = art.Simulation(rig, ground=True, collisions=art.Collisions(pairs=near)).run(q, duration=10.0, fps=5)
        where = places(run)[:, 5:]
        assert np.abs(where - where[:, :1]).max() < 1e-5


NEXT_IN_WALL = [(0, 1), (1, 2), (2, 3), (4, 5), (5, 6), (7, 8)]
NEXT_IN_WALL += [(0, 4), (1, 4), (1, 5), (2, 5), (2, 6), (3, 6), (4, 7), (5, 7), (5, 8), (6, 8), (7, 9), (8, 9)]


class TestFriction:
    @pytest.mark.parametrize("beyond", [-0.5, 0.5])
    def test_a_box_on_a_box_slides_at_the_angle_of_friction(self, beyond):
        """Half a degree before it stays, half a degree beyond it goes as it must."""
        angle = np.arctan(0.5) + np.radians(beyond)
        gravity = 9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)])
        slab, crate = loose(art.Box((2.0, 2.0, 0.2)), 50.0), loose(art.Box((0.2, 0.2, 0.1)), 1.0)
        rig = art.compose(slab=slab, crate=crate)
        q = rig.neutral()
        put(rig, q, 0, (0.0, 0.0, 0.1))
        put(rig, q, 1, (-0.5, 0.0, 0.25))
        settings = {"ground": art.Ground(friction=5.0), "collisions": art.Collisions(friction=0.5), "tolerance": 1e-6}
        run = art.Simulation(rig, gravity=gravity, **settings).run(q, duration=2.0, fps=20)
        moved = places(run)[1, :, 0] - places(run)[0, :, 0]
        if beyond < 0.0:
            assert np.abs(moved[5:] - moved[5]).max() < 1e-5
        else:
            expected = 9.81 * (np.sin(angle) - 0.5 * np.cos(angle))
            assert acceleration(run, moved) == pytest.approx(expected, rel=0.02)

    def test_a_box_is_pushed_with_balls_on_it(self):
        """SimBenchmark's rolling test: straight and obliquely; balls roll on the box, the box slides on the ground."""
        parts = {"box": loose(art.Box((2.0, 2.0, 0.2)), 10.0)} | {f"ball{k}": loose(art.Sphere(0.1), 1.0) for k in range(25)}
        rig = art.compose(**parts)
        q = rig.neutral()
        put(rig, q, 0, (0.0, 0.0, 0.1))
        for k in range(25):
            put(rig, q, 1 + k, (0.35 * (k % 5 - 2), 0.35 * (k // 5 - 2), 0.3))
        collisions = art.Collisions(friction=0.8, exclude=[("ball*", "ball*")])
        ground = {"ground": art.Ground(friction=0.4), "contact_points": ["box/body"]}
        simulation = art.Simulation(rig, collisions=collisions, tolerance=1e-5, **ground)
        for angle in (0.0, 0.25 * np.pi, 0.3):
            along = np.array([np.cos(angle), np.sin(angle), 0.0])
            force = np.zeros((rig.nlinks, 6))
            force[rig.links["box/body"].index, :3] = 150.0 * along
            run = simulation.run(q, duration=1.0, fps=50, external=force)
            where = places(run) @ along
            assert acceleration(run, where[0]) == pytest.approx(0.7385, rel=0.005)
            for ball in where[1:]:
                assert acceleration(run, ball) == pytest.approx(0.211, rel=0.01)


class TestImpact:
    def test_newtons_cradle(self):
        """The last ball flies as high as the first one fell; those between stay."""
        count, radius, length = 5, 0.05, 1.0
        rig = art.compose(**{f"ball{k}": pendulum(radius, length, 2.0 * radius * k) for k in range(count)})
        collisions = art.Collisions(restitution=1.0, friction=0.0)
        q = np.zeros(count)
        q[0] = 0.5
        run = art.Simulation(rig, dt=1e-3, collisions=collisions).run(q, duration=1.5, fps=100)
        highest = np.abs(run.q[:130]).max(axis=0)
        assert highest[4] == pytest.approx(0.5, rel=0.01)
        assert highest[1:4].max() < 0.01
        assert np.abs(run.q[60:140, 0]).max() < 0.01
        assert run.energy.max() < run.energy[0] + 1e-3
        two = q.copy()
        two[1] = 0.5  # two fall, two fly
        run = art.Simulation(rig, dt=1e-3, collisions=collisions).run(two, duration=1.2, fps=100)
        highest = np.abs(run.q[60:]).max(axis=0)
        assert highest[3:] == pytest.approx(0.5, rel=0.03)
        assert highest[:3].max() < 0.03

    @pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
    @pytest.mark.parametrize("masses", [(1.0, 1.0), (1.0, 10.0)])
    def test_balls_that_meet(self, e, masses):
        """Newton's law, head on: speeds after are those of the textbook."""
        rig = art.compose(a=loose(art.Sphere(0.1), masses[0]), b=loose(art.Sphere(0.1), masses[1]))
        q, v = rig.neutral(), np.zeros(rig.nv)
        put(rig, q, 1, (0.5, 0.0, 0.0))
        v[0], v[6] = 2.0, -1.0
        collisions = art.Collisions(restitution=e, friction=0.3)
        run = art.Simulation(rig, gravity=(0, 0, 0), dt=1e-3, collisions=collisions).run(q, v, duration=0.5, fps=50)
        (m, n), mean = masses, (2.0 * masses[0] - masses[1]) / sum(masses)
        after = mean - e * 3.0 * n / (m + n), mean + e * 3.0 * m / (m + n)
        # without restitution, what sank in is pushed out at 0.1 m/s
        assert run.v[-1, [0, 6]] == pytest.approx(after, abs=0.1 if e == 0.0 else 2e-3)

    def test_bouncing(self):
        """SimBenchmark's bouncing test, of six balls of different heights: their energy stays; low ones bounce often."""
        rig = art.compose(**{f"ball{k}": loose(art.Sphere(0.1), 1.0) for k in range(6)})
        q = rig.neutral()
        for k in range(6):
            put(rig, q, k, (0.25 * (k % 3), 0.25 * (k // 3), 0.3 + 0.3 * k))
        rebounds = {"restitution": 1.0, "friction": 0.0}
        run = art.Simulation(rig, ground=art.Ground(**rebounds), collisions=art.Collisions(**rebounds)).run(q, duration=20.0)
        assert np.abs(run.energy / run.energy[0] - 1.0).max() < 0.01
        for k, height in enumerate(places(run)[:, :, 2]):
            assert height[-60:].max() == pytest.approx(0.3 + 0.3 * k, abs=0.005)

    def test_a_block_of_balls_collapses(self):
        """As SimBenchmark's 666, of 12 balls without friction, nearly above each other: it comes down, and that is all."""
        rig = art.compose(**{f"ball{k}": loose(art.Sphere(0.1), 10.0) for k in range(12)})
        q, rng = rig.neutral(), np.random.default_rng(0)
        for k in range(12):
            put(rig, q, k, (*(0.21 * np.array([k % 2, k // 2 % 2]) + rng.uniform(-1e-3, 1e-3, 2)), 1.101 + 0.21 * (k // 4)))
        slippery = {"friction": 0.0}
        simulation = art.Simulation(rig, ground=art.Ground(**slippery), collisions=art.Collisions(**slippery))
        run = simulation.run(q, duration=5.0, fps=20)
        assert (run.energy - np.minimum.accumulate(run.energy)).max() < 1e-3 * run.energy[0]  # what bends springs back
        assert run.energy[-1] < 0.2 * run.energy[0]
        assert run.contact_gaps.min() > -1e-3

    @pytest.mark.parametrize("jointed", [False, True])
    def test_momentum(self, jointed):
        """Things that fly into each other, spinning: what there is in all stays to rounding.

        Of what has joints or rebounds, that is the linear part: in a step centres stray from a straight way.
        """
        links = art.RigBuilder("chain")
        for k in range(3):
            links.link(f"link{k}", 1.0, (0.1, 0, 0), (0.002, 0.01, 0.01), [art.Shape(art.Capsule(0.04, 0.12), ALONG_X)])
            if k:
                links.joint(f"joint{k}", "ball", f"link{k - 1}", f"link{k}", xyz=(0.2, 0, 0))
        chain = links.build("free") if jointed else loose(art.Box((0.6, 0.1, 0.1)), 2.0)
        rig = art.compose(chain=chain, box=loose(art.Box((0.2, 0.3, 0.1)), 2.0), ball=loose(art.Sphere(0.1), 1.0))
        q, v = rig.neutral(), np.zeros(rig.nv)
        put(rig, q, 1, (0.25, 0.4, 0.03))
        put(rig, q, 2, (0.3, -0.4, 0.03))
        v[:] = np.random.default_rng(2).normal(size=rig.nv)
        box, ball = (joint.v_slice.start for joint in free(rig)[1:])
        v[box : box + 3], v[ball : ball + 3] = (0.0, -3.0, 0.0), (0.0, 4.0, 0.0)
        for e in (0.0,) if jointed else (0.0, 0.6):
            collisions = art.Collisions(friction=0.5, restitution=e)
            run = art.Simulation(rig, gravity=(0, 0, 0), collisions=collisions).run(q, v, duration=0.4, fps=500)
            assert (np.abs(run.contact_forces).max(axis=(0, 2)) > 10.0).sum() > 1
            solved = [total_momentum(rig, *before(rig, *x)) for x in zip(run.q[1:], run.v[1:], strict=True)]
            change = np.abs(np.array(solved) - total_momentum(rig, q, v))
            change = change if e == 0.0 else change[-20:]  # in a step with a rebound, positions move otherwise
            assert change[:, : 3 if jointed or e > 0.0 else 6].max() < 1e-12
            assert run.energy.max() < run.energy[0] * (1.0 + 1e-5)
            assert run.energy[-1] < 0.95 * run.energy[0]

    def test_forces_are_told(self):
        """On a link and on what it touches, one against the other."""
        rig = art.compose(a=loose(art.Sphere(0.1), 1.0), b=loose(art.Sphere(0.1), 3.0))
        q = rig.neutral()
        put(rig, q, 0, (0.0, 0.0, 0.1))
        put(rig, q, 1, (0.0, 0.0, 0.3))
        simulation = art.Simulation(rig, ground=True, collisions=True)
        state = simulation.reset(q)
        for _ in range(200):
            state = simulation.step(state)
        contacts = simulation.contacts(state)
        assert contacts.links == ("a/body", "b/body", "a/body")
        assert contacts.others == ("", "", "b/body")
        assert contacts.on("b/body") == pytest.approx([0.0, 0.0, 3.0 * 9.81], rel=1e-6, abs=1e-9)
        assert contacts.on("a/body") == pytest.approx([0.0, 0.0, 9.81], rel=1e-6, abs=1e-9)
        assert contacts.touching.tolist() == [True, False, True]


ALONG_X = np.array([[0.0, 0.0, 1.0, 0.1], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def pendulum(radius, length, x):
    builder = art.RigBuilder("pendulum")
    builder.link("base")
    down = np.eye(4)
    down[2, 3] = -length
    inertia = 0.4 * radius**2 * np.eye(3)
    builder.link("ball", 1.0, (0, 0, -length), inertia, collisions=[art.Shape(art.Sphere(radius), down)])
    builder.joint("hinge", "revolute", "base", "ball", axis=(0, 1, 0), xyz=(x, 0, 0))
    return builder.build()


class TestScenery:
    def test_what_stands_in_the_world(self):
        """A ball on a step that is scenery, one on a table that is part of the rig, and one that falls between."""
        table = art.RigBuilder("table")
        table.link("top", collisions=[art.Shape(art.Box((1.0, 1.0, 0.1)), at(2.0, 0.0, 0.45))])
        parts = {f"ball{k}": loose(art.Sphere(0.1), 1.0) for k in range(3)}
        rig = art.compose(table=table.build(), **parts)
        q = rig.neutral()
        for k, x in enumerate((0.0, 2.0, 1.0)):
            put(rig, q, k, (x, 0.0, 1.0))
        scenery = [art.Shape(art.Box((1.0, 1.0, 0.2)), at(0.0, 0.0, 0.1)), art.Shape(art.Capsule(0.05, 1.0), at(5.0, 0.0, 0.0))]
        run = art.Simulation(rig, ground=True, collisions=art.Collisions(scenery=scenery)).run(q, duration=2.0, fps=10)
        assert places(run)[:, -1, 2] == pytest.approx([0.3, 0.6, 0.1], abs=2e-3)
        assert "scenery" in run.contact_others
        assert "table/top" in run.contact_others

    def test_no_ground_is_needed(self):
        rig, floor = loose(art.Sphere(0.1), 1.0), art.Shape(art.Box((2.0, 2.0, 0.2)))
        run = art.Simulation(rig, collisions=art.Collisions(scenery=floor)).run([0, 0, 0.5, 0, 0, 0, 1], duration=1.0, fps=10)
        assert run.q[-1, 2] == pytest.approx(0.2, abs=1e-3)


def at(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


@pytest.mark.parametrize("integrator", ["rk4", "dopri5"])
def test_smooth_methods_feel_pairs_too(integrator):
    """With the same stiffness they come to the same motion, gently."""
    rig = art.compose(a=loose(art.Sphere(0.1), 1.0), b=loose(art.Sphere(0.1), 2.0))
    q, v = rig.neutral(), np.zeros(rig.nv)
    put(rig, q, 1, (0.25, 0.02, 0.0))
    v[0] = 1.0
    collisions = art.Collisions(stiffness=2e3, dissipation=0.3, friction=0.2)
    settings = {"gravity": (0, 0, 0), "collisions": collisions}
    fine = art.Simulation(rig, dt=1e-4, tolerance=1e-8, **settings).run(q, v, duration=0.3, fps=100)
    run = art.Simulation(rig, dt=5e-4, integrator=integrator, **settings).run(q, v, duration=0.3, fps=100)
    assert np.abs(fine.v[-1] - v).max() > 0.3
    assert np.abs(run.q - fine.q).max() < 2e-3
    assert np.abs(run.energy - run.energy[0] - run.work).max() < 5e-3
