"""BVH files of skeletons as other tools write them: their names, their axes, their orders of channels, and random turns."""

from __future__ import annotations

from pathlib import Path

import numpy as np

MIXAMO = """
mixamorig:Hips - 0 95 0
mixamorig:Spine mixamorig:Hips 0 10 -1
mixamorig:Spine1 mixamorig:Spine 0 12 0
mixamorig:Spine2 mixamorig:Spine1 0 13 0
mixamorig:Neck mixamorig:Spine2 0 15 1
mixamorig:Head mixamorig:Neck 0 9 2
mixamorig:LeftShoulder mixamorig:Spine2 6 11 0
mixamorig:LeftArm mixamorig:LeftShoulder 12 0 0
mixamorig:LeftForeArm mixamorig:LeftArm 27 0 0
mixamorig:LeftHand mixamorig:LeftForeArm 26 0 0
mixamorig:RightShoulder mixamorig:Spine2 -6 11 0
mixamorig:RightArm mixamorig:RightShoulder -12 0 0
mixamorig:RightForeArm mixamorig:RightArm -27 0 0
mixamorig:RightHand mixamorig:RightForeArm -26 0 0
mixamorig:LeftUpLeg mixamorig:Hips 9 -6 0
mixamorig:LeftLeg mixamorig:LeftUpLeg 0 -42 0
mixamorig:LeftFoot mixamorig:LeftLeg 0 -43 -1
mixamorig:LeftToeBase mixamorig:LeftFoot 0 -8 12
mixamorig:RightUpLeg mixamorig:Hips -9 -6 0
mixamorig:RightLeg mixamorig:RightUpLeg 0 -42 0
mixamorig:RightFoot mixamorig:RightLeg 0 -43 -1
mixamorig:RightToeBase mixamorig:RightFoot 0 -8 12
"""
"""y up, z forward, centimetres."""

COLLAR = """
hip - 0 0 38
abdomen hip 0 0 4
chest abdomen 0 0 7
neck chest 0 -0.5 9
head neck 0 0 3.5
lCollar chest 1 0 7
lShldr lCollar 6 0 0
lForeArm lShldr 11 0 0
lHand lForeArm 10 0 0
rCollar chest -1 0 7
rShldr rCollar -6 0 0
rForeArm rShldr -11 0 0
rHand rForeArm -10 0 0
lThigh hip 3.5 0 -1
lShin lThigh 0 0 -17
lFoot lShin 0 0.5 -17
rThigh hip -3.5 0 -1
rShin rThigh 0 0 -17
rFoot rShin 0 0.5 -17
"""
"""z up, looking along −y, inches."""

ENDS = {"Head": "0 18 0", "LeftHand": "15 0 0", "RightHand": "-15 0 0", "LeftToeBase": "0 0 8", "RightToeBase": "0 0 8"}
COLLAR_ENDS = {"head": "0 0 7", "lHand": "6 0 0", "rHand": "-6 0 0", "lFoot": "0 -7 -2", "rFoot": "0 -7 -2"}

ORDERS = ("ZXY", "XYZ", "YXZ", "ZYX", "YZX", "XZY")


def bvh_text(table: str, ends: dict[str, str], frames: int = 12, seed: int = 0, frame_time: float = 1 / 30) -> str:
    """A file of this skeleton, whose joints turn smoothly; each has another order of channels than the last."""
    rows = [line.split() for line in table.strip().splitlines()]
    rng = np.random.default_rng(seed)
    lines, columns = ["HIERARCHY"], []
    t = np.arange(frames)[:, None] * frame_time
    start = np.array([float(x) for x in rows[0][2:]])

    def write(k: int, depth: int) -> None:
        name, _, *offset = rows[k]
        tabs, order = "  " * depth, ORDERS[k % len(ORDERS)]
        lines.extend([f"{tabs}{'JOINT' if depth else 'ROOT'} {name}", tabs + "{", f"{tabs}  OFFSET {' '.join(offset)}"])
        turning = " ".join(f"{axis}rotation" for axis in order)
        lines.append(f"{tabs}  CHANNELS {3 if depth else 6} {'' if depth else 'Xposition Yposition Zposition '}{turning}")
        if not depth:
            columns.append(start + 5.0 * np.sin(t + rng.uniform(0, 6, 3)))
        columns.append(40.0 * np.sin(rng.uniform(2, 5, 3) * t + rng.uniform(0, 6, 3)))
        short = name.split(":")[-1]
        if short in ends:
            lines.extend([f"{tabs}  End Site", tabs + "  {", f"{tabs}    OFFSET {ends[short]}", tabs + "  }"])
        for child, row in enumerate(rows):
            if row[1] == name:
                write(child, depth + 1)
        lines.append(tabs + "}")

    write(0, 0)
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time: {frame_time:.9g}"]
    lines += [" ".join(f"{x:.6f}" for x in row) for row in np.hstack(columns)]
    return "\n".join(lines) + "\n"


CHAIN = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 50 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 40 0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 90 0 0 0 0 0 0 0
0 90 1 0 5 0 10 0 0
0 90 2 0 9 0 20 0 0
"""
"""As little as a file can be; y is up."""


def written(folder: Path, text: str, name: str = "clip.bvh") -> Path:
    path = folder / name
    path.write_text(text)
    return path
