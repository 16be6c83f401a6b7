"""What reaches far."""

from __future__ import annotations

import articulated as art
from makers.maker import DARK, RED, STEEL, YELLOW, Maker, ball, box, rod, tube

PIVOT, FOOT, BOOM = 3.0, 0.3, 6.0
"""How high and how far ahead the boom's hinge is, and the length of its outermost section [m]."""


def telescope() -> art.RigBuilder:
    """A crane: slewing tower, luffing boom, three sections that slide as one, a hook on a chain"""
    b = Maker("telescope")
    b.part("base", 15000.0, [box((3.4, 3.4, 0.6), (0, 0, 0.3), DARK)])
    tower = [box((1.0, 1.2, 2.4), (0, 0, 1.9), YELLOW), box((1.1, 1.8, 0.9), (-1.05, 0, 1.2), DARK)]
    slew = {"axis": (0, 0, 1), "limits": art.Limits(effort=6e4, velocity=0.5), "damping": 2e4, "joint": "slew"}
    b.part("tower", 9000.0, tower, "continuous", "base", (0, 0, 0.6), **slew)
    x = FOOT
    luff = {"axis": (0, -1, 0), "limits": art.Limits(0.0, 1.3, effort=1.2e6, velocity=0.2), "damping": 5e4, "joint": "luff"}
    section = box((BOOM, 0.66, 0.66), (x + 0.5 * BOOM, 0, PIVOT), YELLOW)
    b.part("boom", 1500.0, [section], "revolute", "tower", (x, 0, PIVOT), **luff)
    above, tip = "boom", x + BOOM
    for k, (thick, mass) in enumerate(((0.54, 1000.0), (0.42, 700.0), (0.32, 500.0))):
        tip = round(tip + 0.25, 3)
        inner = box((5.8, thick, thick), (tip - 2.9, 0, PIVOT), (RED, YELLOW, RED)[k])
        slide = {"axis": (1, 0, 0), "limits": art.Limits(0.0, 4.5, effort=6e4, velocity=0.6), "damping": 2e3 if k == 0 else 0.0}
        slide |= {"joint": "extend"} if k == 0 else {"joint": f"follow{k}", "mimic": art.Mimic("extend")}
        b.part(f"section{k + 1}", mass, [inner], "prismatic", above, (tip - 5.8, 0, PIVOT), **slide)
        above = f"section{k + 1}"
    _hook(b, above, round(tip - 0.1, 3), PIVOT - 0.16)
    return b


def _hook(b: Maker, above: str, x: float, z: float) -> None:
    """Four links of chain, a block and a hook."""
    swing = {"limits": art.Limits(upper=1.5), "damping": 5.0}
    for k in range(4):
        low = round(z - 0.35, 3)
        link = rod((x, 0, z - 0.04), (x, 0, low + 0.04), 0.04, STEEL)
        b.part(f"chain{k + 1}", 15.0, [link], "ball", above, (x, 0, z), joint=f"chain_joint{k + 1}", **swing)
        above, z = f"chain{k + 1}", low
    block = [box((0.34, 0.2, 0.36), (x, 0, z - 0.18), RED), tube((x, 0, z - 0.36), (x, 0, z - 0.5), 0.05, STEEL)]
    block += [rod((x, 0, z - 0.52), (x + 0.12, 0, z - 0.58), 0.045, STEEL), ball(0.05, (x + 0.15, 0, z - 0.5), STEEL)]
    b.part("hook", 250.0, block, "ball", above, (x, 0, z), joint="hook_joint", **swing)
