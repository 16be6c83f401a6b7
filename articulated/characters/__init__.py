"""Characters: what tracks a motion, falls and gets up, stands and steps."""

from articulated.characters.audit import Audit, audit
from articulated.characters.balance import Stander
from articulated.characters.bvh import from_bvh
from articulated.characters.gains import tuned
from articulated.characters.ground import grounded
from articulated.characters.limits import fit_swing_twist
from articulated.characters.pushes import Pushes
from articulated.characters.reaching import Reached, reach
from articulated.characters.repair import repaired
from articulated.characters.retarget import retarget
from articulated.characters.tracking import Tracker

__all__ = [
    "Audit",
    "Pushes",
    "Reached",
    "Stander",
    "Tracker",
    "audit",
    "fit_swing_twist",
    "from_bvh",
    "grounded",
    "reach",
    "repaired",
    "retarget",
    "tuned",
]
