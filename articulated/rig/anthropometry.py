"""Masses, lengths and inertias of the segments of the human body.

P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J. Biomechanics 29(9), 1996, table 4: means of
15 women (1.735 m, 61.9 kg) and 100 men (1.741 m, 73.0 kg), young and fit, measured lying with a gamma scanner. The numbers
below are those of the table: a length in mm, a mass in % of the body's, the rest in % of the length of the segment.

The axes of a segment are those of the anatomical posture (standing, palms forward, feet as if on their toes): longitudinal from
end to end, sagittal forwards, transverse to the side. So the sagittal axis of a hand is normal to its palm, and that of a foot
to its sole.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

MEAN_HEIGHT = MappingProxyType({"female": 1.735, "male": 1.741})
"""Of the people measured, by sex [m]."""

MEAN_MASS = MappingProxyType({"female": 61.9, "male": 73.0})
"""Of the people measured, by sex [kg]."""

BOTH_SIDES = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
"""The segments that a body has two of."""


@dataclass(frozen=True)
class Segment:
    """A part of the body, between two landmarks.

    Attributes:
        name: what it is called here.
        proximal, distal: the landmarks at its ends.
        length: between these, in the mean body [m].
        mass: part of the body's.
        center: of mass, on the line from the proximal to the distal end, as a part of the length.
        sagittal, transverse, longitudinal: radii of gyration about the axes through that centre, as parts of the length.
    """

    name: str
    proximal: str
    distal: str
    length: float
    mass: float
    center: float
    sagittal: float
    transverse: float
    longitudinal: float


def segments(sex: str) -> Mapping[str, Segment]:
    """The ten segments of a body by name, from head to foot; those of `BOTH_SIDES` count twice.

    The masses add up to 1, or to what the printed digits of the table make of it (0.9999 for women).

    Raises:
        ValueError: `sex` is neither "female" nor "male".
    """
    return _SEGMENTS[_sex(sex)]


def other_ends(sex: str) -> Mapping[str, Segment]:
    """The same parts of the body between other landmarks, and the whole trunk: "head to cervicale", "shank to ankle", ….

    Raises:
        ValueError: `sex` is neither "female" nor "male".
    """
    return _OTHER_ENDS[_sex(sex)]


def _sex(given: Any) -> str:
    if not isinstance(given, str) or given not in MEAN_HEIGHT:
        raise ValueError(f"sex is {given!r}; expected 'female' or 'male', the two columns of de Leva's table")
    return given


def _table(text: str) -> dict[str, Mapping[str, Segment]]:
    result: dict[str, dict[str, Segment]] = {"female": {}, "male": {}}
    for line in text.strip().splitlines():
        name, proximal, distal, *columns = (cell.strip() for cell in line.split("|"))
        for column, sex in enumerate(("female", "male")):
            length, *parts = (float(cell.split()[column]) for cell in columns)
            result[sex][name] = Segment(
                name, proximal, distal, round(1e-3 * length, 4), *(round(1e-2 * part, 4) for part in parts)
            )
    return {sex: MappingProxyType(rows) for sex, rows in result.items()}


# each cell is female, male: name | proximal end | distal end | length | mass | centre | sagittal | transverse | longitudinal
_SEGMENTS = _table("""
head         | vertex         | mid-gonion     | 200.2 203.3 |  6.68  6.94 | 58.94 59.76 | 33.0 36.2 | 35.9 37.6 | 31.8 31.2
upper_trunk  | suprasternale  | xiphion        | 142.5 170.7 | 15.45 15.96 | 20.77 29.99 | 74.6 71.6 | 50.2 45.4 | 71.8 65.9
middle_trunk | xiphion        | omphalion      | 205.3 215.5 | 14.65 16.33 | 45.12 45.02 | 43.3 48.2 | 35.4 38.3 | 41.5 46.8
lower_trunk  | omphalion      | mid-hip        | 181.5 145.7 | 12.47 11.17 | 49.20 61.15 | 43.3 61.5 | 40.2 55.1 | 44.4 58.7
upper_arm    | shoulder       | elbow          | 275.1 281.7 |  2.55  2.71 | 57.54 57.72 | 27.8 28.5 | 26.0 26.9 | 14.8 15.8
forearm      | elbow          | wrist          | 264.3 268.9 |  1.38  1.62 | 45.59 45.74 | 26.1 27.6 | 25.7 26.5 |  9.4 12.1
hand         | wrist          | metacarpale 3  |  78.0  86.2 |  0.56  0.61 | 74.74 79.00 | 53.1 62.8 | 45.4 51.3 | 33.5 40.1
thigh        | hip            | knee           | 368.5 422.2 | 14.78 14.16 | 36.12 40.95 | 36.9 32.9 | 36.4 32.9 | 16.2 14.9
shank        | knee           | lat. malleolus | 432.3 434.0 |  4.81  4.33 | 44.16 44.59 | 27.1 25.5 | 26.7 24.9 |  9.3 10.3
foot         | heel           | longest toe    | 228.3 258.1 |  1.29  1.37 | 40.14 44.15 | 29.9 25.7 | 27.9 24.5 | 13.9 12.4
""")

_OTHER_ENDS = _table("""
head to cervicale         |vertex       |cervicale    |243.7 242.9| 6.68  6.94|48.41 50.02|27.1 30.3|29.5 31.5|26.1 26.1
trunk                     |suprasternale|mid-hip      |529.3 531.9|42.57 43.46|41.51 44.86|35.7 37.2|33.9 34.7|17.1 19.1
trunk from cervicale      |cervicale    |mid-hip      |614.8 603.3|42.57 43.46|49.64 51.38|30.7 32.8|29.2 30.6|14.7 16.9
trunk from shoulders      |mid-shoulder |mid-hip      |497.9 515.5|42.57 43.46|37.82 43.10|37.9 38.4|36.1 35.8|18.2 19.7
upper_trunk from cervicale|cervicale    |xiphion      |228.0 242.1|15.45 15.96|50.50 50.66|46.6 50.5|31.4 32.0|44.9 46.5
forearm to stylion        |elbow        |stylion      |262.4 266.9| 1.38  1.62|45.92 46.08|26.3 27.8|25.9 26.7| 9.5 12.2
hand to fingertip         |wrist        |dactylion 3  |170.1 187.9| 0.56  0.61|34.27 36.24|24.4 28.8|20.8 23.5|15.4 18.4
hand, stylion to fingertip|stylion      |dactylion 3  |172.0 189.9| 0.56  0.61|35.02 36.91|24.1 28.5|20.6 23.3|15.2 18.2
hand from stylion         |stylion      |metacarpale 3| 79.9  88.2| 0.56  0.61|75.34 79.48|51.9 61.4|44.3 50.2|32.7 39.2
shank to ankle            |knee         |ankle        |438.6 440.3| 4.81  4.33|43.52 43.95|26.7 25.1|26.3 24.6| 9.2 10.2
shank to sphyrion         |knee         |sphyrion     |426.0 427.7| 4.81  4.33|44.81 45.24|27.5 25.8|27.1 25.3| 9.4 10.5
""")
