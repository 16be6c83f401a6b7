"""articulated: a reduced-coordinate articulated-body engine for character rigs.

URDF in, trajectory out. See README.md for a start, and the docstrings of what is listed here for everything else.
"""

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
from articulated.simulation import FirstOrder, Simulation, State, first_order, simulate
from articulated.trajectory import Check, Outcome, Report, Trajectory

__version__ = "0.1.0"
