"""articulated: a reduced-coordinate articulated-body engine for character rigs.

URDF in, trajectory out. See README.md for a start, and the docstrings of what is listed here for everything else.
"""

from articulated.dynamics.boundary import GRAVITY
from articulated.dynamics.functions import (
    bias_forces,
    center_of_mass,
    difference,
    forward_dynamics,
    gravity_forces,
    integrate,
    inverse_dynamics,
    jacobian,
    kinetic_energy,
    link_poses,
    link_velocities,
    mass_matrix,
    momentum,
    passive_forces,
    point_wrench,
    potential_energy,
)
from articulated.export import export_c
from articulated.rig import (
    Box,
    Capsule,
    Cylinder,
    Joint,
    Limits,
    Link,
    Mesh,
    Mimic,
    Rig,
    RigBuilder,
    RigError,
    RigWarning,
    Shape,
    Sphere,
    load,
    shipped_rigs,
)
from articulated.simulation import INTEGRATORS, FirstOrder, Simulation, State, first_order, simulate
from articulated.trajectory import Check, Outcome, Report, Trajectory

__version__ = "0.1.0"

__all__ = [
    "GRAVITY",
    "INTEGRATORS",
    "Box",
    "Capsule",
    "Check",
    "Cylinder",
    "FirstOrder",
    "Joint",
    "Limits",
    "Link",
    "Mesh",
    "Mimic",
    "Outcome",
    "Report",
    "Rig",
    "RigBuilder",
    "RigError",
    "RigWarning",
    "Shape",
    "Simulation",
    "Sphere",
    "State",
    "Trajectory",
    "bias_forces",
    "center_of_mass",
    "difference",
    "export_c",
    "first_order",
    "forward_dynamics",
    "gravity_forces",
    "integrate",
    "inverse_dynamics",
    "jacobian",
    "kinetic_energy",
    "link_poses",
    "link_velocities",
    "load",
    "mass_matrix",
    "momentum",
    "passive_forces",
    "point_wrench",
    "potential_energy",
    "shipped_rigs",
    "simulate",
]
