"""The frozen description of a rig, and where it comes from."""

from articulated.rig.builder import RigBuilder
from articulated.rig.compose import compose
from articulated.rig.errors import RigError, RigWarning
from articulated.rig.joint import KINDS, Joint, Limits, Mimic
from articulated.rig.load import load, shipped_rigs
from articulated.rig.loop import Loop
from articulated.rig.loose import loose_body
from articulated.rig.mass import MassProperties, mass_properties
from articulated.rig.person import person
from articulated.rig.rig import Body, Link, Rig
from articulated.rig.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Hollow, Mesh, Shape, Sphere
from articulated.rig.standing import standing_height
from articulated.rig.swing_twist import SwingTwist

__all__ = [
    "KINDS",
    "Body",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "Hollow",
    "Joint",
    "Limits",
    "Link",
    "Loop",
    "MassProperties",
    "Mesh",
    "Mimic",
    "Rig",
    "RigBuilder",
    "RigError",
    "RigWarning",
    "Shape",
    "Sphere",
    "SwingTwist",
    "compose",
    "load",
    "loose_body",
    "mass_properties",
    "person",
    "shipped_rigs",
    "standing_height",
]
