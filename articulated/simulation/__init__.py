"""Moving a rig in time."""

from articulated.simulation.first_order import FirstOrder, first_order
from articulated.simulation.methods import INTEGRATORS
from articulated.simulation.simulation import Simulation, simulate
from articulated.simulation.state import State

__all__ = ["INTEGRATORS", "FirstOrder", "Simulation", "State", "first_order", "simulate"]
