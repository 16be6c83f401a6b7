"""URDF in and out."""

from articulated.rig.urdf.reader import read_urdf
from articulated.rig.urdf.writer import urdf_text

__all__ = ["read_urdf", "urdf_text"]
