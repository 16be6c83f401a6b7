r"""Theo Jansen's walking mechanism, with the lengths of its rods as he published them: his "holy numbers".

T. Jansen, The Great Pretender, 2007. A tenth of a metre is ten of his units.

      A          A, B     where the rods j and k from the crank's pin C end
     / \  C      P        where the leg hangs on the frame
    D---P  O     D, E     b, d, e are one triangle of rods: P A D; g, h, i another: B E F
    |   |        F        the foot
    E---B
     \ /
      F
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

import articulated as art
from makers.maker import BLUE, DARK, RED, RUBBER, STEEL, WOOD, YELLOW, Maker, ball, box, meeting, rod

JANSEN = {"a": 38.0, "b": 41.5, "c": 39.3, "d": 40.1, "e": 55.8, "f": 39.4, "g": 36.7}
JANSEN |= {"h": 65.7, "i": 49.0, "j": 50.0, "k": 61.9, "l": 7.8, "m": 15.0}
UNIT = 0.01

OUTER, INNER = 0.36, 0.14
"""How far to either side the legs are [m]. Those of one distance turn in step, so that left and right are one link."""


def strandbeest() -> art.RigBuilder:
    """Theo Jansen's beach animal: one crank, twelve loops, eight feet; it walks"""
    b = Maker("strandbeest")
    L = {name: UNIT * length for name, length in JANSEN.items()}
    beams = [box((0.94, 0.05, 0.06), (0, y, -L["l"]), WOOD) for y in (0.47, -0.47)]
    beams += [rod((x, -0.47, -L["l"]), (x, 0.47, -L["l"]), 0.02, WOOD) for x in (L["a"], -L["a"])]
    touches = [rod((0.44, y, -L["l"]), (-0.44, y, -L["l"]), 0.03) for y in (0.47, -0.47)]
    b.part("frame", 10.0, beams, touches=touches)
    angle = math.radians(20.0)
    pin = np.round(L["m"] * np.array([math.cos(angle), math.sin(angle)]), 6)
    shaft = [rod((0, -0.47, 0), (0, 0.47, 0), 0.018, DARK)]
    for distance, sign in ((OUTER, 1.0), (INNER, -1.0)):
        for y in (distance, -distance):
            shaft.append(rod((0, y, 0), _in_space(sign * pin, y), 0.018, DARK))
    b.part("crankshaft", 2.0, shaft, "continuous", "frame", joint="crank", axis=(0, -1, 0), damping=0.2, touches=())
    for row, distance, sign in (("outer", OUTER, 1.0), ("inner", INNER, -1.0)):
        for end, x in (("front", 1.0), ("rear", -1.0)):
            _leg(b, f"{row}_{end}", L, sign * pin, distance, x)
    return b


def corners(L: dict[str, float], C: np.ndarray) -> dict[str, np.ndarray]:
    """Of a leg towards -x, in the plane of x and z, by the place of the crank's pin."""
    P = np.array([-L["a"], -L["l"]])
    A = meeting(C, L["j"], P, L["b"], -1.0)
    B = meeting(C, L["k"], P, L["c"], 1.0)
    D = meeting(P, L["d"], A, L["e"], 1.0)
    E = meeting(D, L["f"], B, L["g"], -1.0)
    F = meeting(E, L["h"], B, L["i"], -1.0)
    return {"C": C, "P": P, "A": A, "B": B, "D": D, "E": E, "F": F}


def _leg(b: Maker, name: str, L: dict[str, float], pin: np.ndarray, distance: float, x: float) -> None:
    """A pair of legs, left and right. Axes are parallel: loops that are points hold it as hinges would, with fewer rows."""
    mirror = np.array([-x, 1.0])
    at = {corner: mirror * place for corner, place in corners(L, mirror * pin).items()}

    def link(part: str, mass: float, above: str, rods: Sequence[str], color, touches: Sequence[art.Shape] = ()) -> None:
        """Rods, each named by its two ends; it hangs by the first of these."""
        start = at[rods[0][0]]
        solid = [rod(_in_space(at[p], y), _in_space(at[q], y), 0.014, color) for y in (distance, -distance) for p, q in rods]
        joint = {"axis": (0, -1, 0), "damping": 0.01, "touches": touches}
        b.part(f"{name}_{part}", mass, solid, "continuous", above, _in_space(start, 0.0), **joint)

    sides = (distance, -distance)
    link("j", 0.4, "crankshaft", ["CA"], STEEL)
    link("k", 0.4, "crankshaft", ["CB"], STEEL)
    link("upper", 1.0, "frame", ["PA", "PD", "AD"], BLUE)
    link("c", 0.3, "frame", ["PB"], YELLOW)
    link("f", 0.3, f"{name}_upper", ["DE"], YELLOW)
    feet = [ball(0.03, _in_space(at["F"], y), RUBBER) for y in sides]
    link("foot", 1.0, f"{name}_c", ["BE", "BF", "EF"], RED, feet)
    for corner, one, other in (("A", "j", "upper"), ("B", "k", "c"), ("E", "f", "foot")):
        b.close(f"{name}_{corner}", "point", f"{name}_{one}", f"{name}_{other}", _in_space(at[corner], 0.0))


def _in_space(place: np.ndarray, y: float) -> tuple[float, float, float]:
    return float(place[0]), y, float(place[1])
