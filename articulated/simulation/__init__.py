"""Moving a rig in time."""

from articulated.simulation.actuation import PD, RootHelp, Stops
from articulated.simulation.command import Command
from articulated.simulation.contact.candidates import ContactPoint
from articulated.simulation.contact.choosing import CollisionPairs, collision_pairs
from articulated.simulation.contact.collisions import Collisions
from articulated.simulation.contact.ground import Ground, Material
from articulated.simulation.contact.sensing import Contacts
from articulated.simulation.contact.surfaces import HeightField, Plane, Stairs
from articulated.simulation.first_order import FirstOrder, first_order
from articulated.simulation.methods import INTEGRATORS
from articulated.simulation.simulation import Simulation, simulate
from articulated.simulation.state import State

__all__ = [
    "INTEGRATORS",
    "PD",
    "CollisionPairs",
    "Collisions",
    "Command",
    "ContactPoint",
    "Contacts",
    "FirstOrder",
    "Ground",
    "HeightField",
    "Material",
    "Plane",
    "RootHelp",
    "Simulation",
    "Stairs",
    "State",
    "Stops",
    "collision_pairs",
    "first_order",
    "simulate",
]
