"""Bars in closed loops."""

from __future__ import annotations

import math

import articulated as art
from makers.plain_maker import PlainMaker


def four_bar() -> art.RigBuilder:
    """A crank that turns, a rocker that swings, and a coupler between them: a closed loop."""
    b = PlainMaker("four_bar")
    b.box("base", 1.0, (1.1, 0.02, 0.02), (0.5, 0, 0))
    crank, coupler, rocker, base = 0.3, 0.9, 0.7, 1.0
    angle = 1.0
    x, z = base - crank * math.cos(angle), -crank * math.sin(angle)
    r, direction = math.hypot(x, z), math.atan2(z, x)
    above = direction + math.acos((coupler**2 + r**2 - rocker**2) / (2 * coupler * r))
    swung = direction + math.pi - math.acos((rocker**2 + r**2 - coupler**2) / (2 * rocker * r))
    for name, length, mass in (("crank", crank, 1.0), ("coupler", coupler, 2.0), ("rocker", rocker, 1.5)):
        b.box(name, mass, (length, 0.03, 0.03), (0.5 * length, 0, 0))
    hinge = {"axis": (0, -1, 0)}
    b.joint("crank", "continuous", "base", "crank", rpy=(0, -angle, 0), **hinge)
    b.joint("coupler", "continuous", "crank", "coupler", xyz=(crank, 0, 0), rpy=(0, angle - above, 0), **hinge)
    b.joint("rocker", "continuous", "base", "rocker", xyz=(base, 0, 0), rpy=(0, -swung, 0), **hinge)
    b.loop(art.Loop("hinge", "coupler", (coupler, 0, 0), "rocker", (rocker, 0, 0), axis=(0, 1, 0), name="tip"))
    return b
