"""Rigs with closed loops, and configurations in which these are closed."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from conftest import example_robots
from contact_rigs import ROBOTS
from scipy.spatial.transform import Rotation

import articulated as art


def pose(xyz=(0.0, 0.0, 0.0), rotvec=(0.0, 0.0, 0.0)) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(rotvec).as_matrix(), xyz
    return X


def rod(builder, name, length, mass=1.0, thick=0.02):
    """A rod along x from its link's origin."""
    along, across = mass * thick**2 / 6.0, mass * (length**2 + thick**2) / 12.0
    builder.link(name, mass, (length / 2, 0, 0), (along, across, across))


def four_bar(lengths=(0.3, 0.9, 0.7), base=1.0, masses=(1.0, 2.0, 1.5)) -> art.Rig:
    """A crank-rocker in the x-z plane."""
    builder = art.RigBuilder("four bar")
    builder.link("base")
    for name, length, mass in zip(("crank", "coupler", "rocker"), lengths, masses, strict=True):
        rod(builder, name, length, mass, thick=0.0)
    builder.joint("j1", "continuous", "base", "crank", axis=(0, -1, 0))
    builder.joint("j2", "continuous", "crank", "coupler", xyz=(lengths[0], 0, 0), axis=(0, -1, 0))
    builder.joint("j3", "continuous", "base", "rocker", xyz=(base, 0, 0), axis=(0, -1, 0))
    builder.loop(art.Loop("hinge", "coupler", (lengths[1], 0, 0), "rocker", (lengths[2], 0, 0), axis=(0, 1, 0), name="tip"))
    return builder.build()


def n_four_bar(n: int) -> art.Rig:
    """IFToMM A02: n four-bars side by side, of 2 n + 1 rods of 1 m and 1 kg; up at q = 0."""
    builder = art.RigBuilder(f"{n} four bars")
    builder.link("base")
    for k in range(n + 1):
        builder.link(f"rod{k}", 1.0, (0, 0, 0.5), (1 / 12, 1 / 12, 0.0))
        builder.joint(f"pivot{k}", "continuous", "base", f"rod{k}", xyz=(k, 0, 0), axis=(0, 1, 0))
    for k in range(n):
        builder.link(f"bar{k}", 1.0, (0.5, 0, 0), (0.0, 1 / 12, 1 / 12))
        builder.joint(f"knee{k}", "continuous", f"rod{k}", f"bar{k}", xyz=(0, 0, 1), axis=(0, 1, 0))
        builder.loop(art.Loop("hinge", f"bar{k}", (1, 0, 0), f"rod{k + 1}", (0, 0, 1), axis=(0, 1, 0), name=f"loop{k}"))
    return builder.build()


def bricard(square=0.0) -> art.Rig:
    """IFToMM A04, with y for its height: five rods of 1 m and 1 kg, hinges along y, z, x, y, z, x; square sides if wanted."""
    points = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], float)
    axes = [(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)]
    builder = art.RigBuilder("bricard")
    builder.link("base")
    for k in range(5):
        d = points[k + 1] - points[k]
        across, along = (1 + square**2) / 12.0, square**2 / 6.0
        builder.link(f"rod{k}", 1.0, d / 2, np.diag(across + (along - across) * np.abs(d)))
        above, at = ("base", points[0]) if k == 0 else (f"rod{k - 1}", points[k] - points[k - 1])
        builder.joint(f"hinge{k}", "continuous", above, f"rod{k}", xyz=at, axis=axes[k])
    end = points[5] - points[4]
    builder.loop(art.Loop("hinge", None, points[5], "rod4", end, axis=axes[5], name="last"))
    return builder.build()


ALPHA, BETA = math.radians(35.0), math.radians(70.0)


def bennett(a=1.0, alpha=ALPHA, beta=BETA) -> art.Rig:
    """Four rods with skew hinges: by their number no joint could move. Bennett 1903: a/sin α = b/sin β."""
    b = a * math.sin(beta) / math.sin(alpha)
    builder = art.RigBuilder("bennett")
    builder.link("base")
    sides = [(b, beta), (a, alpha), (b, beta), (a, alpha)]
    above, X = "base", np.eye(4)
    for k, (length, _) in enumerate(sides[:3]):
        rod(builder, f"rod{k}", length)
        builder.joint(f"hinge{k}", "continuous", above, f"rod{k}", pose=X, axis=(0, 0, 1))
        above, X = f"rod{k}", pose((length, 0, 0)) @ pose(rotvec=(sides[k][1], 0, 0))
    last = np.linalg.inv(pose((a, 0, 0)) @ pose(rotvec=(alpha, 0, 0)))  # the base is the fourth rod
    builder.loop(art.Loop("hinge", "rod2", X, None, last, axis=(0, 0, 1), name="last"))
    return builder.build()


def bennett_angles(theta, alpha=ALPHA, beta=BETA) -> np.ndarray:
    """Of the first three hinges: tan(θ₁/2) tan(θ₂/2) is constant, θ₃ = −θ₁."""
    product = -math.sin(0.5 * (beta + alpha)) / math.sin(0.5 * (beta - alpha))
    return np.array([theta, 2.0 * math.atan2(product, math.tan(0.5 * theta)), -theta])


JANSEN = {"a": 38.0, "b": 41.5, "c": 39.3, "d": 40.1, "e": 55.8, "f": 39.4, "g": 36.7}
JANSEN |= {"h": 65.7, "i": 49.0, "j": 50.0, "k": 61.9, "l": 7.8, "m": 15.0}
_AT_ZERO = {
    "A": (-24.014, 31.272),
    "B": (-26.952, -45.515),
    "D": (-74.794, 8.143),
    "E": (-59.232, -28.053),
    "F": (-43.160, -91.757),
}


def jansen() -> art.Rig:
    """A leg of the Strandbeest in the x-z plane, a tenth of a metre for ten of Jansen's units: eleven rods, three loops."""
    L = {name: 0.01 * length for name, length in JANSEN.items()}
    at = {name: 0.01 * np.array(xy) for name, xy in _AT_ZERO.items()} | {
        "P": np.array([-L["a"], -L["l"]]),
        "C": np.array([L["m"], 0]),
    }
    builder = art.RigBuilder("strandbeest leg")
    builder.link("frame")

    def body(name, start, corners, mass):
        """A link whose axes are the world's where the crank is at 0; its corners are thin rods."""
        origin, ends = at.get(start, np.zeros(2)), [at[c] for c in corners]
        total, J, center = sum(np.linalg.norm(e - origin) for e in ends), 0.0, np.zeros(2)
        for e in ends:
            part, d = mass * np.linalg.norm(e - origin) / total, e - origin
            center, J = center + part * d / 2, J + part * d @ d / 3
        center /= mass
        J -= mass * center @ center
        builder.link(name, mass, (center[0], 0, center[1]), (J / 2, J, J / 2), collisions=[])
        return origin

    def joint(name, above, above_at, child, start):
        d = at.get(start, np.zeros(2)) - above_at
        builder.joint(name, "continuous", above, child, xyz=(d[0], 0, d[1]), axis=(0, -1, 0))

    o = np.zeros(2)
    body("crank", "O", ["C"], 0.5)
    joint("crank", "frame", o, "crank", "O")
    body("j", "C", ["A"], 0.3)
    joint("j", "crank", o, "j", "C")
    body("upper", "P", ["A", "D"], 0.6)  # rods b, d, e: one triangle
    joint("upper", "frame", o, "upper", "P")
    body("k", "C", ["B"], 0.3)
    joint("k", "crank", o, "k", "C")
    body("c", "P", ["B"], 0.3)
    joint("c", "frame", o, "c", "P")
    body("f", "D", ["E"], 0.3)
    joint("f", "upper", at["P"], "f", "D")
    body("foot", "B", ["E", "F"], 0.6)  # rods g, h, i: one triangle
    joint("foot", "c", at["P"], "foot", "B")

    def tie(name, a, start_a, b, start_b, point):
        da, db = at[point] - at[start_a], at[point] - at[start_b]
        builder.loop(art.Loop("hinge", a, (da[0], 0, da[1]), b, (db[0], 0, db[1]), axis=(0, 1, 0), name=name))

    tie("A", "j", "C", "upper", "P", "A")
    tie("B", "k", "C", "c", "P", "B")
    tie("E", "f", "D", "foot", "B", "E")
    return builder.build()


def slider_crank() -> art.Rig:
    """A crank, its rod, and a block that a slider loop keeps on a rail."""
    builder = art.RigBuilder("slider crank")
    builder.link("base")
    rod(builder, "crank", 0.3)
    rod(builder, "rod", 0.8)
    builder.link("block", 2.0, (0, 0, 0), (0.01, 0.01, 0.01))
    builder.joint("j1", "continuous", "base", "crank", axis=(0, -1, 0))
    builder.joint("j2", "continuous", "crank", "rod", xyz=(0.3, 0, 0), axis=(0, -1, 0))
    builder.joint("j3", "continuous", "rod", "block", xyz=(0.8, 0, 0), axis=(0, -1, 0))
    builder.loop(art.Loop("slider", None, None, "block", None, axis=(1, 0, 0), name="rail"))
    return builder.build()


def delta() -> art.Rig:
    """A delta robot: three driven arms, three pairs of rods on balls, and a plate. Sizes of the Omnid project's."""
    builder = art.RigBuilder("delta")
    builder.link("base")
    builder.link("plate", 0.5, (0, 0, 0), (1e-3, 1e-3, 2e-3))
    builder.joint("plate", "floating", "base", "plate", xyz=(0, 0, -0.3))
    for k in range(3):
        turn = pose(rotvec=(0, 0, 2.0 * math.pi * k / 3.0))
        rod(builder, f"arm{k}", 0.2)
        builder.joint(f"arm{k}", "continuous", "base", f"arm{k}", pose=turn @ pose((0.18, 0, 0)), axis=(0, 1, 0))
        for side, y in (("l", 0.03), ("r", -0.03)):
            rod(builder, f"rod{k}{side}", 0.368, 0.2)
            builder.joint(
                f"rod{k}{side}", "universal", f"arm{k}", f"rod{k}{side}", xyz=(0.2, y, 0), axis=(0, 1, 0), axis2=(0, 0, 1)
            )
            on_plate = (turn @ [0.062, y, 0, 1.0])[:3]
            builder.loop(art.Loop("point", f"rod{k}{side}", (0.368, 0, 0), "plate", on_plate, name=f"ball{k}{side}"))
    return builder.build()


def scissor(n=3) -> art.Rig:
    """A scissor lift of n storeys in the x-z plane, on a pin and a roller; a_k rise to the right, b_k to the left."""
    builder = art.RigBuilder("scissor")
    builder.link("base")
    builder.link("roller", 0.5, (0, 0, 0), (1e-3, 1e-3, 1e-3))
    builder.joint("roller", "prismatic", "base", "roller", axis=(1, 0, 0), limits=art.Limits(0.05, 0.99))
    builder.loop(art.Loop("hinge", "roller", None, "b0", (-0.5, 0, 0), axis=(0, 1, 0), name="roller"))
    for k in range(n):
        rod(builder, f"a{k}", 1.0)
        builder.link(f"b{k}", 1.0, (0, 0, 0), (1e-4, 1 / 12, 1 / 12))
        above, at = ("base", (0, 0, 0)) if k == 0 else (f"b{k - 1}", (0.5, 0, 0))
        builder.joint(f"a{k}", "continuous", above, f"a{k}", xyz=at, axis=(0, -1, 0))
        builder.joint(f"b{k}", "continuous", f"a{k}", f"b{k}", xyz=(0.5, 0, 0), axis=(0, -1, 0))
        if k:
            builder.loop(art.Loop("hinge", f"a{k - 1}", (1, 0, 0), f"b{k}", (-0.5, 0, 0), axis=(0, 1, 0), name=f"right{k}"))
    return builder.build()


def crane() -> art.Rig:
    """A boom that a cylinder and its piston push: one body on a hinge, two more, and a cylindrical loop."""
    builder = art.RigBuilder("crane")
    builder.link("base")
    rod(builder, "boom", 4.0, 200.0, 0.3)
    rod(builder, "barrel", 1.2, 40.0, 0.2)
    rod(builder, "piston", 1.2, 20.0, 0.1)
    builder.joint("boom", "revolute", "base", "boom", axis=(0, -1, 0), limits=art.Limits(-0.2, 1.4))
    builder.joint("barrel", "ball", "base", "barrel", xyz=(0.8, 0, -1.0))
    builder.joint("piston", "ball", "boom", "piston", xyz=(1.5, 0, -0.1))
    builder.loop(art.Loop("cylindrical", "barrel", None, "piston", None, axis=(1, 0, 0), name="bore"))
    return builder.build()


def table() -> art.Rig:
    """A plate that slides on a tilted table, with a pendulum on it, and a rod from the pendulum's bob to the world."""
    builder = art.RigBuilder("table")
    builder.link("base")
    builder.link("plate", 1.0, (0, 0, 0), (0.02, 0.02, 0.04))
    builder.link("bob", 0.5, (0, 0, 0.3), (0.01, 0.01, 0.005))
    builder.joint("plate", "floating", "base", "plate")
    builder.joint("ball", "ball", "plate", "bob")
    builder.loop(art.Loop("planar", None, pose(rotvec=(0.2, 0.3, 0)), "plate", None, axis=(0, 0, 1), name="table"))
    builder.loop(art.Loop("distance", None, (0.4, 0, 1.0), "bob", (0, 0, 0.5), length=0.8, name="rod"))
    return builder.build()


def shafts() -> art.Rig:
    """Two shafts at an angle, joined by two universal joints and a shaft between them that may lengthen."""
    builder = art.RigBuilder("shafts")
    builder.link("base")
    for name in ("in", "half", "other", "out"):
        rod(builder, name, 0.3, 1.0, 0.1)
    builder.joint("in", "continuous", "base", "in", axis=(1, 0, 0))
    builder.joint("u1", "universal", "in", "half", xyz=(0.3, 0, 0), axis=(0, 1, 0), axis2=(0, 0, 1))
    builder.joint("slide", "prismatic", "half", "other", xyz=(0.3, 0, 0), axis=(1, 0, 0), limits=art.Limits(-0.2, 0.5))
    builder.joint("out", "continuous", "base", "out", pose=pose((0.9, 0.15, 0.1), (0, 0, 0.3)), axis=(1, 0, 0))
    builder.loop(art.Loop("universal", "other", (0.3, 0, 0), "out", None, axis=(0, 0, 1), axis2=(0, 1, 0), name="u2"))
    return builder.build()


def gears() -> art.Rig:
    """A rack that a pinion moves, the pinion turned through a mimic of the wheel: a tie between joints only."""
    builder = art.RigBuilder("gears")
    builder.link("base")
    rod(builder, "wheel", 0.3, 1.0, 0.1)
    rod(builder, "pinion", 0.1, 1.0, 0.1)
    rod(builder, "rack", 0.5, 2.0)
    rod(builder, "arm", 0.4, 0.5)
    builder.joint("wheel", "continuous", "base", "wheel", axis=(0, 1, 0))
    builder.joint("pinion", "continuous", "base", "pinion", xyz=(0, 0.2, 0), axis=(0, 0, 1), mimic=art.Mimic("wheel", 2.0, 0.1))
    builder.joint("rack", "prismatic", "base", "rack", xyz=(0, 0.3, 0), axis=(1, 0, 0), limits=art.Limits(-5.0, 5.0))
    builder.joint("arm", "ball", "rack", "arm", xyz=(0.5, 0, 0))
    builder.loop(art.Loop("gear", "pinion", None, "rack", None, ratio=0.1, offset=0.02, name="teeth"))
    return builder.build()


def car() -> art.Rig:
    """A car: in front two wheels on five links each, one of them the track rod of a rack and pinion, and struts; trailing arms behind.

    Links of the suspension are rods without mass. Struts and trailing arms have springs where a PD drives them.
    """
    builder = art.RigBuilder("car")
    box = 800.0 / 12.0
    builder.link(
        "chassis",
        800.0,
        (0, 0, 0.5),
        (box * 3.0, box * 10.0, box * 12.0),
        collisions=[art.Shape(art.Box((3.6, 1.4, 0.5)), pose((0, 0, 0.65)))],
    )
    builder.link("column", 1.0, (0, 0, 0), (1e-3, 1e-3, 1e-3))
    builder.link("rack", 4.0, (0, 0, 0), (0.05, 1e-3, 0.05))
    builder.joint("column", "continuous", "chassis", "column", xyz=(1.0, 0, 0.5), axis=(1, 0, 0))
    builder.joint("rack", "prismatic", "chassis", "rack", xyz=(1.15, 0, 0.35), axis=(0, 1, 0), limits=art.Limits(-0.08, 0.08))
    builder.loop(art.Loop("gear", "column", None, "rack", None, ratio=0.02, name="rack and pinion"))
    for side, y in (("left", 1.0), ("right", -1.0)):
        hub = np.array([1.3, 0.75 * y, 0.3])
        builder.link(f"{side}_knuckle", 15.0, (0, 0, 0), (0.2, 0.2, 0.2))
        builder.joint(f"{side}_knuckle", "floating", "chassis", f"{side}_knuckle", xyz=hub)
        wheel(builder, f"front_{side}", f"{side}_knuckle", (0, 0, 0))
        # five links: two above, two below, and the track rod
        ends = {
            "upper_front": ((0.12, -0.3, 0.15), (0.02, -0.03, 0.18)),
            "upper_rear": ((-0.15, -0.3, 0.15), (-0.02, -0.03, 0.18)),
        }
        ends |= {
            "lower_front": ((0.15, -0.4, -0.1), (0.02, -0.03, -0.12)),
            "lower_rear": ((-0.2, -0.4, -0.1), (-0.02, -0.03, -0.12)),
        }
        for name, (inner, outer) in ends.items():
            p, r = (np.array([x, z * y, u]) for x, z, u in (inner, outer))
            builder.loop(
                art.Loop(
                    "distance",
                    "chassis",
                    hub + p,
                    f"{side}_knuckle",
                    r,
                    length=float(np.linalg.norm(p - r)),
                    name=f"{side}_{name}",
                )
            )
        outer = np.array([-0.13, -0.03 * y, 0.05])
        inner = np.array([1.15, 0.35 * y, 0.35])
        at = np.array([0.0, 0.35 * y, 0.0])
        length = float(np.linalg.norm(inner - hub - outer))
        builder.loop(art.Loop("distance", "rack", at, f"{side}_knuckle", outer, length=length, name=f"{side}_track_rod"))
        top = hub + np.array([0.0, -0.12 * y, 0.5])
        builder.link(f"{side}_strut", 2.0, (0, 0, -0.1), (0.01, 0.01, 1e-3))
        builder.link(f"{side}_piston", 1.0, (0, 0, 0.1), (0.005, 0.005, 5e-4))
        builder.joint(f"{side}_strut", "universal", "chassis", f"{side}_strut", xyz=top, axis=(1, 0, 0), axis2=(0, 1, 0))
        builder.joint(
            f"{side}_spring",
            "prismatic",
            f"{side}_strut",
            f"{side}_piston",
            xyz=(0, 0, -0.5),
            axis=(0, 0, 1),
            limits=art.Limits(-0.12, 0.12),
        )
        builder.loop(art.Loop("point", f"{side}_piston", None, f"{side}_knuckle", (0, -0.12 * y, 0), name=f"{side}_strut"))
        builder.link(f"{side}_arm", 12.0, (-0.2, 0, 0), (0.05, 0.3, 0.3))
        builder.joint(
            f"{side}_arm",
            "revolute",
            "chassis",
            f"{side}_arm",
            xyz=(-0.9, 0.6 * y, 0.35),
            axis=(0, 1, 0),
            limits=art.Limits(-0.4, 0.4),
        )
        wheel(builder, f"rear_{side}", f"{side}_arm", (-0.4, 0.15 * y, -0.05))
    return builder.build("free")


def wheel(builder, name, parent, at):
    shape = art.Shape(art.Sphere(0.3))
    builder.link(name, 15.0, (0, 0, 0), (0.4, 0.7, 0.4), collisions=[shape])
    builder.joint(name, "continuous", parent, name, xyz=at, axis=(0, 1, 0))


@cache
def robot(name: str) -> art.Rig:
    return art.load(example_robots() / ROBOTS[name], root="free")


def hands_on_bar() -> tuple[art.Rig, list[art.Loop], np.ndarray]:
    """A person who holds a free bar with both hands; with a configuration that closes it."""
    bar = art.RigBuilder("bar")
    bar.link("bar", 2.0, (0, 0, 0), (0.2, 1e-3, 0.2), collisions=[art.Capsule(0.02, 1.0)])
    rig = art.compose(person=art.load("ragdoll", root="free"), bar=bar.build("free"))
    loops = [
        art.Loop("weld", "person/left_hand", (0, 0, -0.1), "bar/bar", pose((0, 0.25, 0), (0, 0, 0)), name="left grip"),
        art.Loop("weld", "person/right_hand", (0, 0, -0.1), "bar/bar", pose((0, -0.25, 0), (0, 0, 0)), name="right grip"),
    ]
    return rig, loops, rig.neutral()


def holding_hands() -> tuple[art.Rig, list[art.Loop], np.ndarray]:
    """Two people side by side, one's left hand in the other's right."""
    person = art.load("ragdoll", root="free")
    rig = art.compose(left=person, right=person)
    loops = [art.Loop("point", "left/right_hand", (0, 0, -0.1), "right/left_hand", (0, 0, -0.1), name="hands")]
    q = rig.neutral()
    q[rig.joints["left/root_joint"].q_slice.start + 1] = 0.45
    q[rig.joints["right/root_joint"].q_slice.start + 1] = -0.45
    return rig, loops, q


def guesses() -> dict[str, tuple[art.Rig, list[art.Loop], np.ndarray]]:
    """All mechanisms, with their loops and where to start to assemble them."""
    result = {}

    def add(name, rig, q=None, **angles):
        guess = rig.neutral() if q is None else np.array(q, float)
        for joint, angle in angles.items():
            guess[rig.joints[joint].q_slice] = angle
        result[name] = rig, list(rig.loops), guess

    add("four bar", four_bar(), [1.0, -0.4, 1.6])
    add("n four bar", n_four_bar(4))
    add("bricard", bricard())
    add("bennett", bennett(), bennett_angles(1.0))
    add("strandbeest", jansen())
    add("slider crank", slider_crank(), [0.8, -1.2, 0.4])
    add("delta", delta(), **{f"arm{k}": 0.3 for k in range(3)}, **{f"rod{k}{s}": (1.2, 0.0) for k in range(3) for s in "lr"})
    add(
        "scissor",
        scissor(),
        roller=0.8,
        a0=0.6,
        b0=math.pi - 1.2,
        **{f"a{k}": 1.2 - math.pi for k in (1, 2)},
        **{f"b{k}": math.pi - 1.2 for k in (1, 2)},
    )
    half = math.sqrt(0.5)
    add("crane", crane(), boom=0.5, barrel=(0, -math.sin(0.6), 0, math.cos(0.6)), piston=(0, half, 0, half))
    add("table", table())
    add("shafts", shafts())
    add("gears", gears())
    add("car", car())
    for name, make in (("bar", hands_on_bar), ("hands", holding_hands)):
        result[name] = make()
    return result
