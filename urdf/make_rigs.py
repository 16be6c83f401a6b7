"""Writes the rigs beside it, and what each shows: `python urdf/make_rigs.py`."""

from __future__ import annotations

from pathlib import Path

from makers.bicyclists import bicyclist
from makers.cars import buggy, car
from makers.cranes import telescope
from makers.hair import ponytail
from makers.linkages import four_bar
from makers.loose import ball, box
from makers.pendulums import cartpole, double_pendulum, pendulum
from makers.quadrupeds import quadruped
from makers.ragdolls import ragdoll
from makers.strandbeests import strandbeest

HERE = Path(__file__).resolve().parent

MAKERS = [
    ball,
    bicyclist,
    box,
    buggy,
    car,
    cartpole,
    double_pendulum,
    four_bar,
    pendulum,
    ponytail,
    quadruped,
    ragdoll,
    strandbeest,
    telescope,
]
"""The name of a maker is that of its rig, and the first line of its docstring what the rig shows."""


def lines() -> str:
    """A line for each rig: its name, and what it shows."""
    return "".join(f"{make.__name__}: {(make.__doc__ or '').splitlines()[0]}\n" for make in MAKERS)


if __name__ == "__main__":
    for make in MAKERS:
        (HERE / f"{make.__name__}.urdf").write_text(make().build().to_urdf())
        print(f"wrote {make.__name__}.urdf")
    (HERE / "rigs.txt").write_text(lines(), encoding="utf-8")
    print("wrote rigs.txt")
