"""A chain of many light links on a heavy one."""

from __future__ import annotations

import articulated as art
from makers.maker import SKIN, WOOD, Maker, ball, rod

LOCKS, LENGTH = 12, 0.04


def ponytail() -> art.RigBuilder:
    """A head with a tail of hair: twelve light links on balls"""
    b = Maker("ponytail")
    face = [ball(0.018, (0.1, 0, -0.01), SKIN)]
    b.part("head", 4.5, [ball(0.1, (0, 0, 0), SKIN)], looks=face)
    parent, z = "head", 0.04
    for k in range(LOCKS):
        radius = round(0.018 - 0.001 * k, 3)
        lock = rod((-0.09, 0, z - 0.25 * radius), (-0.09, 0, z - LENGTH + 0.25 * radius), radius, WOOD)
        b.part(
            f"lock{k + 1}",
            round(0.02 - 0.001 * k, 3),
            [lock],
            "ball",
            parent,
            (-0.09, 0, z),
            joint=f"hair{k + 1}",
            limits=art.Limits(upper=1.4 if k == 0 else 0.6),
            damping=1e-4,
            armature=1e-6,
        )
        parent, z = f"lock{k + 1}", round(z - LENGTH, 3)
    return b
