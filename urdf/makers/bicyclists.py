"""A rider whose hands and feet close loops with a bicycle.

The bicycle's sizes are those of a common road bicycle: wheels of 0.34 m, a head angle of 72°, a trail of 6 cm. Masses of the
rider are near those of an adult of 75 kg (Winter, Biomechanics and Motor Control of Human Movement, table 4.1).
"""

from __future__ import annotations

import math

import numpy as np

import articulated as art
from makers.maker import BLUE, DARK, RED, RUBBER, SKIN, STEEL, YELLOW, Maker, Point, ball, box, disc, meeting, rod, tube

WHEEL, CRANK = 0.34, 0.17
REAR, FRONT, BOTTOM = np.array([-0.42, 0.0, WHEEL]), np.array([0.6, 0.0, WHEEL]), np.array([0.0, 0.0, 0.28])
"""Where the wheels' and the crank's axles are [m]; the ground is at z = 0."""

HEAD = math.radians(72.0)
STEERING = (round(-math.cos(HEAD), 6), 0.0, round(math.sin(HEAD), 6))
OFFSET = 0.045
"""Of the front axle from the steering axis [m]."""

SADDLE = np.array([-0.18, 0.0, 0.94])
HEAD_TUBE = np.array([0.387, 0.0, 0.85])
"""Its upper end, on the steering axis: `trail` depends on it."""

GEAR = 2.5
"""Turns of the rear wheel for one of the crank."""

HIP, SHOULDER, GRIP = np.array([-0.16, 0.1, 1.03]), np.array([0.17, 0.19, 1.4]), np.array([0.46, 0.21, 0.97])
"""Of the left side [m]."""

THIGH, SHIN, UPPER_ARM, FOREARM = 0.43, 0.44, 0.29, 0.31
MUSCLE = {"damping": 2.0, "armature": 0.01}


def bicyclist() -> art.RigBuilder:
    """A rider on a track bicycle: hands and feet in four loops with handlebar and pedals

    The pelvis is fixed to the saddle. The chain has no freewheel: the rear wheel follows the crank.
    """
    b = Maker("bicyclist")
    _bicycle(b)
    _trunk(b)
    for side, y in (("left", 1.0), ("right", -1.0)):
        _leg(b, side, y)
        _arm(b, side, y)
    return b


def _bicycle(b: Maker) -> None:
    seat, neck = SADDLE - (0.0, 0.0, 0.06), HEAD_TUBE - 0.04 * np.array(STEERING)
    low = HEAD_TUBE - 0.18 * np.array(STEERING)
    tubes = [rod(BOTTOM, seat, 0.018, RED), rod(BOTTOM, low, 0.02, RED), rod(seat - (-0.02, 0, 0.1), neck, 0.016, RED)]
    for y in (0.06, -0.06):
        tubes += [rod(REAR + (0, y, 0), BOTTOM, 0.01, RED), rod(REAR + (0, y, 0), seat - (-0.03, 0, 0.12), 0.01, RED)]
    saddle = [box((0.26, 0.13, 0.05), SADDLE - (-0.02, 0, 0.03), DARK)]
    b.part("frame", 6.0, [*tubes, *saddle], touches=[tubes[1], *saddle])
    fork = [rod(HEAD_TUBE, low, 0.022, STEEL)]
    for y in (0.05, -0.05):
        fork.append(rod(low + (0, y, 0), FRONT + (0, y, 0), 0.012, STEEL))
    top = HEAD_TUBE + 0.08 * np.array(STEERING)
    bar = np.array([GRIP[0] - 0.04, 0.0, GRIP[2]])
    fork += [rod(HEAD_TUBE, top, 0.016, DARK), rod(top, bar, 0.014, DARK)]
    handlebar = [rod(bar - (0, 0.17, 0), bar + (0, 0.17, 0), 0.014, DARK)]
    for y in (1.0, -1.0):
        side = np.array([1.0, y, 1.0])
        handlebar.append(rod(bar + (0, 0.17 * y, 0), GRIP * side + (0.03, 0.0, 0.0), 0.016, DARK))
    steered = {"axis": STEERING, "limits": art.Limits(-0.8, 0.8), "damping": 0.2, "joint": "steering"}
    b.part("fork", 3.0, [*fork, *handlebar], "revolute", "frame", np.round(HEAD_TUBE, 6), touches=handlebar, **steered)
    turns = {"axis": (0, 1, 0), "damping": 0.005}
    hub = [disc(0.03, 0.09, FRONT, STEEL)]
    b.part("front_wheel", 1.5, [disc(WHEEL, 0.03, FRONT, RUBBER)], "continuous", "fork", FRONT, looks=hub, **turns)
    _drive(b)


def _drive(b: Maker) -> None:
    """Crank, pedals and the rear wheel; the right pedal is ahead."""
    arms = [tube(BOTTOM - (0, 0.07, 0), BOTTOM + (0, 0.07, 0), 0.015, STEEL), disc(0.09, 0.005, BOTTOM - (0, 0.05, 0), STEEL)]
    for y in (1.0, -1.0):
        root = BOTTOM + (0, 0.065 * y, 0)
        arms.append(rod(root, root - (CRANK * y, 0, 0), 0.012, STEEL))
    b.part("crank", 1.0, arms, "continuous", "frame", BOTTOM, axis=(0, 1, 0), damping=0.05, touches=())
    for side, y in (("left", 1.0), ("right", -1.0)):
        at = pedal(y)
        plate = [box((0.09, 0.08, 0.015), at, DARK)]
        b.part(f"{side}_pedal", 0.2, plate, "continuous", "crank", at, axis=(0, 1, 0), damping=0.01, touches=())
    chain = {"axis": (0, 1, 0), "damping": 0.005, "mimic": art.Mimic("crank", GEAR)}
    hub = [disc(0.04, 0.09, REAR, STEEL)]
    b.part("rear_wheel", 1.8, [disc(WHEEL, 0.03, REAR, RUBBER)], "continuous", "frame", REAR, looks=hub, **chain)


def pedal(y: float) -> np.ndarray:
    """Of the left side (1) or the right (-1)."""
    return BOTTOM + (-CRANK * y, HIP[1] * y, 0.0)


def _trunk(b: Maker) -> None:
    hips = HIP * (1, 0, 1)
    b.part("pelvis", 10.5, [rod(HIP * (1, 0.5, 1), HIP * (1, -0.5, 1), 0.095, DARK)], "fixed", "frame", hips, joint="seat")
    waist = hips + (0.04, 0, 0.06)
    chest = SHOULDER * (1, 0, 1)
    back = [box((0.2, 0.3, 0.44), 0.5 * (waist + chest) + (-0.01, 0, 0), BLUE, along=chest - waist)]
    b.part("torso", 26.0, back, "ball", "pelvis", waist, joint="waist", limits=art.Limits(upper=0.6), **MUSCLE)
    neck = chest + (0.04, 0, 0.06)
    skull = [rod(neck + (0.05, 0, 0.1), neck + (0.06, 0, 0.18), 0.09, SKIN)]
    helmet = [ball(0.1, neck + (0.05, 0, 0.21), YELLOW)]
    b.part("head", 6.0, skull, "ball", "torso", neck, joint="neck", looks=helmet, limits=art.Limits(upper=0.6), **MUSCLE)


def _leg(b: Maker, side: str, y: float) -> None:
    hip, on = HIP * (1, y, 1), pedal(y)
    ankle = on + (-0.11, 0.0, 0.11)
    x, z = meeting(hip[[0, 2]], THIGH, ankle[[0, 2]], SHIN, 1.0)
    knee = np.array([x, hip[1], z])
    bent = _bend(hip, knee, ankle)
    flex = {"axis": (0, 1, 0), "limits": art.Limits(-0.9, 1.2)}
    b.part(
        f"{side}_thigh", 7.5, [rod(hip, knee, 0.065, DARK)], "revolute", "pelvis", hip, joint=f"{side}_hip", **flex, **MUSCLE
    )
    flex["limits"] = art.Limits(-bent, round(2.5 - bent, 6))
    b.part(
        f"{side}_shin",
        3.5,
        [rod(knee, ankle, 0.045, SKIN)],
        "revolute",
        f"{side}_thigh",
        knee,
        joint=f"{side}_knee",
        **flex,
        **MUSCLE,
    )
    flex["limits"] = art.Limits(-0.7, 0.7)
    shoe = [rod(ankle + (-0.02, 0, -0.04), on + (0.04, 0, 0.035), 0.035, RED)]
    weak = {"damping": 0.5, "armature": 0.002}
    b.part(f"{side}_foot", 1.1, shoe, "revolute", f"{side}_shin", ankle, joint=f"{side}_ankle", **flex, **weak)
    b.close(f"{side}_cleat", "weld", f"{side}_foot", f"{side}_pedal", on)


def _arm(b: Maker, side: str, y: float) -> None:
    """The elbow hangs below the line from shoulder to grip, and a little outside of it."""
    shoulder, grip = SHOULDER * (1, y, 1), GRIP * (1, y, 1)
    way = grip - shoulder
    d = np.linalg.norm(way)
    reach = FOREARM + 0.07
    along = (d * d + UPPER_ARM**2 - reach**2) / (2.0 * d)
    down = np.array([0.0, 0.35 * y, -1.0])
    down -= way * (way @ down) / (d * d)
    elbow = np.round(shoulder + along * way / d + math.sqrt(UPPER_ARM**2 - along**2) * down / np.linalg.norm(down), 6)
    axis = np.cross(elbow - shoulder, grip - elbow)
    bent = _bend(shoulder, elbow, grip)
    upper = [rod(shoulder, elbow, 0.045, BLUE)]
    b.part(
        f"{side}_upper_arm",
        2.1,
        upper,
        "ball",
        "torso",
        shoulder,
        joint=f"{side}_shoulder",
        limits=art.Limits(upper=1.5),
        **MUSCLE,
    )
    flex = {"axis": np.round(axis / np.linalg.norm(axis), 6), "limits": art.Limits(-bent, round(2.5 - bent, 6))}
    wrist = np.round(elbow + (grip - elbow) * FOREARM / reach, 6)
    b.part(
        f"{side}_forearm",
        1.2,
        [rod(elbow, wrist, 0.036, SKIN)],
        "revolute",
        f"{side}_upper_arm",
        elbow,
        joint=f"{side}_elbow",
        **flex,
        **MUSCLE,
    )
    b.part(f"{side}_hand", 0.45, [_fist(wrist, grip)], "fixed", f"{side}_forearm", wrist, joint=f"{side}_wrist")
    b.close(f"{side}_grip", "point", f"{side}_hand", "fork", grip)


def _fist(wrist: Point, grip: Point) -> art.Shape:
    return rod(wrist, grip, 0.034, SKIN)


def _bend(a: np.ndarray, middle: np.ndarray, end: np.ndarray) -> float:
    """By how much a limb is bent [rad]."""
    u, w = middle - a, end - middle
    return round(math.acos(float(u @ w / np.linalg.norm(u) / np.linalg.norm(w))), 6)
