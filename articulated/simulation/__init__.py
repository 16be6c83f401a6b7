"""Moving a rig in time."""

from articulated.simulation.first_order import FirstOrder, first_order
from articulated.simulation.simulation import Simulation, State, simulate

__all__ = ["FirstOrder", "Simulation", "State", "first_order", "simulate"]
