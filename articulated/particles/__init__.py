"""Particle systems: points with mass, what acts on them, and what they run into.

from articulated import particles as ap

system = ap.System(x, forces=[ap.Gravity(), ap.Springs(pairs, stiffness=100.0)], pinned=[0])
system.step(1e-3)
"""

from articulated.particles.attached import Attached, hair_on
from articulated.particles.builders import Fabric, grid_cloth, mesh_cloth, rope
from articulated.particles.colliders import Box, Capsule, Collider, Plane, Sphere
from articulated.particles.fields import attractor, uniform, vortex
from articulated.particles.forces.bending import Bending, hinge_weights
from articulated.particles.forces.drag import Drag
from articulated.particles.forces.force import Force, Law
from articulated.particles.forces.gravity import Acceleration, Gravity
from articulated.particles.forces.own import OwnForce, OwnLaw
from articulated.particles.forces.pressure import TriangleWind
from articulated.particles.forces.springs import Springs
from articulated.particles.height_field import HeightField
from articulated.particles.points import Point
from articulated.particles.solvers.adaptive import Adaptive
from articulated.particles.solvers.implicit import ImplicitEuler
from articulated.particles.solvers.xpbd import XPBD
from articulated.particles.steps import SOLVERS
from articulated.particles.system import System

__all__ = [
    "SOLVERS",
    "XPBD",
    "Acceleration",
    "Adaptive",
    "Attached",
    "Bending",
    "Box",
    "Capsule",
    "Collider",
    "Drag",
    "Fabric",
    "Force",
    "Gravity",
    "HeightField",
    "ImplicitEuler",
    "Law",
    "OwnForce",
    "OwnLaw",
    "Plane",
    "Point",
    "Sphere",
    "Springs",
    "System",
    "TriangleWind",
    "attractor",
    "grid_cloth",
    "hair_on",
    "hinge_weights",
    "mesh_cloth",
    "rope",
    "uniform",
    "vortex",
]
