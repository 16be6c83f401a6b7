"""What drives on four wheels."""

from __future__ import annotations

import articulated as art
from makers.maker import BLUE, DARK, RUBBER, STEEL, Maker, ball, box, disc, rod, tube
from makers.plain_maker import PlainMaker


def buggy() -> art.RigBuilder:
    """A light buggy: four sprung wheels, and steering by a follower"""
    b = PlainMaker("buggy")
    b.box("chassis", 60.0, (1.2, 0.6, 0.25), (0, 0, 0.1))
    for end, x in (("front", 0.45), ("rear", -0.45)):
        for side, y in (("left", 0.4), ("right", -0.4)):
            hub = f"{end}_{side}_hub"
            b.box(hub, 1.0, (0.06, 0.06, 0.06))
            travel = art.Limits(-0.08, 0.08)
            b.joint(
                f"{end}_{side}_spring",
                "prismatic",
                "chassis",
                hub,
                xyz=(x, y, -0.05),
                axis=(0, 0, 1),
                limits=travel,
                damping=200.0,
            )
            if end == "front":
                carrier = f"{end}_{side}_knuckle"
                b.box(carrier, 0.5, (0.05, 0.05, 0.05))
                follow = None if side == "left" else art.Mimic("front_left_steering")
                b.joint(
                    f"{end}_{side}_steering",
                    "revolute",
                    hub,
                    carrier,
                    axis=(0, 0, 1),
                    limits=art.Limits(-0.6, 0.6),
                    mimic=follow,
                )
                hub = carrier
            wheel = f"{end}_{side}_wheel"
            b.round(wheel, 3.0, art.Cylinder(0.18, 0.12), along=(0, 1, 0))
            b.joint(f"{end}_{side}_axle", "continuous", hub, wheel, axis=(0, 1, 0), damping=0.02)
    return b


AXLE, TRACK, KINGPIN, RADIUS = 1.3, 0.75, 0.65, 0.31
"""Of the car: how far axles, wheels and steering axes are from its middle, and its wheels' radius [m]."""

ARM, INWARD = 0.14, 0.05
"""How far the ends of the steering arms are behind the steering axes, and nearer to the middle [m]: inner and outer wheel then
turn about one point, as Ackermann would have it, where the steering wheel is turned by a whole turn."""

SPRUNG, HUB, KNUCKLE, WHEEL = 924.0, 18.0, 8.0, 20.0
"""Masses [kg]. With steering wheel, rack and track rods all weighs 1,100 kg."""


def car() -> art.RigBuilder:
    """A car of 1,100 kg: rack and track rods in loops, four suspensions with stops

    Its springs are not in the file, as URDF has none: they are drives (`art.PD`) of the joints *_suspension, whose targets lie
    beyond by what the load presses them together. The driver turns `steering`; `wheel` joints take torques.
    """
    b = Maker("car")
    glass = (0.55, 0.68, 0.78, 1.0)
    body = [
        box((4.0, 1.2, 0.36), (0, 0, 0.48), BLUE),
        box((4.1, 1.7, 0.26), (0, 0, 0.87), BLUE),
        box((2.1, 1.46, 0.42), (-0.25, 0, 1.21), glass),
    ]
    lamps = [ball(0.08, (2.02, y, 0.87), (0.95, 0.9, 0.6, 1.0)) for y in (0.6, -0.6)]
    touches = [box((4.1, 1.66, 0.7), (0, 0, 0.65)), body[2]]
    b.part("chassis", SPRUNG, body, looks=lamps, touches=touches)
    # to the left is anticlockwise for a driver, who looks along x; 50 mm of rack a turn
    limits = art.Limits(-8.0, 8.0, effort=20.0)
    turned = {"axis": (-1, 0, 0), "limits": limits, "damping": 0.5, "joint": "steering"}
    b.part(
        "steering_wheel",
        2.0,
        [tube((0.3, 0.36, 0.95), (0.33, 0.36, 0.95), 0.18, DARK)],
        "revolute",
        "chassis",
        (0.3, 0.36, 0.95),
        touches=(),
        **turned,
    )
    x = AXLE - ARM
    rack = {"axis": (0, 1, 0), "limits": art.Limits(-0.07, 0.07), "mimic": art.Mimic("steering", -0.008)}
    b.part(
        "rack",
        4.0,
        [rod((x, 0.3, RADIUS), (x, -0.3, RADIUS), 0.02, STEEL)],
        "prismatic",
        "chassis",
        (x, 0, RADIUS),
        touches=(),
        **rack,
    )
    for end, x in (("front", AXLE), ("rear", -AXLE)):
        for side, y in (("left", 1.0), ("right", -1.0)):
            _corner(b, f"{end}_{side}", x, y)
    return b


def _corner(b: Maker, name: str, x: float, y: float) -> None:
    """A wheel and what it hangs on."""
    pivot = (x, KINGPIN * y, RADIUS)
    travel = {"axis": (0, 0, 1), "limits": art.Limits(-0.08, 0.08), "damping": 2000.0, "joint": f"{name}_suspension"}
    hub, knuckle = f"{name}_hub", f"{name}_knuckle"
    b.part(hub, HUB, [box((0.1, 0.08, 0.24), pivot, STEEL)], "prismatic", "chassis", pivot, touches=(), **travel)
    carrier = hub
    if x > 0.0:
        outer, inner = (x - ARM, (KINGPIN - INWARD) * y, RADIUS), (x - ARM, 0.3 * y, RADIUS)
        lock = {"axis": (0, 0, 1), "limits": art.Limits(-0.7, 0.7), "damping": 5.0, "joint": f"{name}_steering"}
        arm = [ball(0.06, pivot, DARK), rod(pivot, outer, 0.02, DARK)]
        b.part(knuckle, KNUCKLE, arm, "revolute", hub, pivot, touches=(), **lock)
        ends = {"axis": (0, 0, 1), "axis2": (1, 0, 0), "damping": 0.1}
        b.part(f"{name}_track_rod", 1.0, [rod(inner, outer, 0.012, STEEL)], "universal", "rack", inner, touches=(), **ends)
        b.close(f"{name}_track_rod_end", "point", f"{name}_track_rod", knuckle, outer)
        carrier = knuckle
    centre = (x, TRACK * y, RADIUS)
    rim = disc(0.19, 0.21, centre, STEEL)
    axle = {"axis": (0, 1, 0), "damping": 0.2}
    b.part(f"{name}_wheel", WHEEL, [disc(RADIUS, 0.2, centre, RUBBER)], "continuous", carrier, centre, looks=[rim], **axle)
