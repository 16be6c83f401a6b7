"""Random rigs: chains, stars, deep and wide trees, with every kind of joint, skew frames and random inertias."""

from __future__ import annotations

import numpy as np

import articulated as art

KINDS = ["revolute", "continuous", "prismatic", "universal", "ball", "planar", "floating"]
SHAPES = {
    "chain": lambda rng, i: i - 1,
    "star": lambda rng, i: 0,
    "deep": lambda rng, i: max(0, i - 1 - rng.integers(3)),
    "wide": lambda rng, i: rng.integers(max(1, min(i, 1 + i // 3))),
}


def random_inertia(rng: np.random.Generator, mass: float) -> np.ndarray:
    """Of some distribution of this mass over a few decimetres."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    second = axes @ np.diag(mass * rng.uniform(0.05, 0.3, 3) ** 2) @ axes.T
    return np.trace(second) * np.eye(3) - second


def random_rig(seed: int, mimic: bool = False, armature: bool = False, size: int | None = None) -> art.Rig:
    """A rig that depends on the seed alone."""
    rng = np.random.default_rng(seed)
    n = size or int(rng.integers(2, 13))
    shape = list(SHAPES)[seed % len(SHAPES)]
    builder = art.RigBuilder(f"{shape} {seed}")
    leaders: list[str] = []
    for i in range(n + 1):
        mass = float(rng.uniform(0.3, 3.0))
        builder.link(f"link{i}", mass, rng.normal(0.0, 0.2, 3), random_inertia(rng, mass))
        if i == 0:
            continue
        kind = KINDS[(seed + i) % len(KINDS)] if i <= 2 else str(rng.choice([*KINDS, "fixed"]))
        one = kind in ("revolute", "continuous", "prismatic")
        follow = None
        if mimic and one and leaders and rng.random() < 0.5:
            follow = art.Mimic(str(rng.choice(leaders)), float(rng.choice([-2.0, -1.0, 0.5, 1.0])), float(rng.normal()))
        builder.joint(
            f"joint{i}",
            kind,
            f"link{SHAPES[shape](rng, i)}",
            f"link{i}",
            xyz=rng.normal(0.0, 0.5, 3),
            rpy=rng.uniform(-3.0, 3.0, 3),
            axis=rng.normal(size=3),
            axis2=rng.normal(size=3) if kind == "universal" else None,
            armature=float(rng.uniform(0.0, 0.1)) if armature else 0.0,
            mimic=follow,
        )
        if one and follow is None:
            leaders.append(f"joint{i}")
    return builder.build(root=["fixed", "free", "planar"][seed % 3])
