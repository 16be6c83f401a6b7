"""Characters: what tracks a motion, falls and gets up, stands and steps."""

from articulated.characters.balance import Stander
from articulated.characters.gains import tuned
from articulated.characters.pushes import Pushes
from articulated.characters.reaching import Reached, reach
from articulated.characters.stepping import Stepper
from articulated.characters.tracking import Tracker

__all__ = ["Pushes", "Reached", "Stander", "Stepper", "Tracker", "reach", "tuned"]
