"""What a motion with contact carries from step to step besides q and v."""

from __future__ import annotations

from dataclasses import dataclass

from articulated.dynamics.mechanism import Mechanism
from articulated.scalar import Scalar
from articulated.simulation.implicit.towing import nothing
from articulated.simulation.scene import Scene


@dataclass(frozen=True, eq=False)
class Stance:
    """See above.

    Attributes:
        anchors: of each contact, how far it has been dragged along the ground while it held [m], along two tangents.
        grips: likewise of each contact between two pieces, in the axes of the second one's body.
        slack: likewise of each coordinate with dry friction [rad or m].
        before: length of the step before [s], 0 at the start of a motion: v belongs to where it was then.
        shift: how much faster positions moved in the last step than velocities say, where things may rebound [rad/s or m/s].
        carry: likewise, how much faster momenta are that go on, where loops bend the way of what they hold.
        contact_forces: of each contact with the ground in the last step, in the world [N].
        pair_forces: of each pair, the force on its first body in the last step [N].
        efforts: what drives gave in the last step [N m or N].
        pulls: forces of loops in the last step, a row each [N or N m].
        residual: the largest of the solver so far [m/s].
        failures: steps so far in which the solver did not reach its tolerance.
        near, met: which contacts with the ground, and which pairs, were near in the last step, as numbers.
        latest: its sweeps.
        sweeps: of all steps so far.
        towing: of bodies that carry particles their velocities as the last step found them; see `Tow.shown`.
    """

    anchors: list[list[Scalar]]
    grips: list[list[Scalar]]
    slack: list[Scalar]
    before: Scalar
    shift: list[Scalar]
    carry: list[Scalar]
    contact_forces: list[list[Scalar]]
    pair_forces: list[list[Scalar]]
    efforts: list[Scalar]
    pulls: list[Scalar]
    residual: Scalar
    failures: Scalar
    near: Scalar
    met: Scalar
    latest: Scalar
    sweeps: Scalar
    towing: list[list[Scalar]]


@dataclass(frozen=True, eq=False)
class Standing:
    """Where a motion is, with its stance."""

    q: list[Scalar]
    v: list[Scalar]
    work: Scalar
    stance: Stance

    @property
    def moved(self) -> list[Scalar]:
        """The velocities with which positions came here."""
        return [a + b for a, b in zip(self.v, self.stance.shift, strict=True)] if self.stance.shift else self.carried

    @property
    def carried(self) -> list[Scalar]:
        """Those of the momenta that go on."""
        return [a + b for a, b in zip(self.v, self.stance.carry, strict=True)] if self.stance.carry else self.v


def unmoved(scene: Scene) -> Stance:
    """The stance of a rig that has touched nothing yet."""
    n, dry = scene.touches, rubbing(scene.mechanism)
    drives = scene.drives.coordinates if scene.drives else ()
    anchors, pushes = [[0.0] * 2 for _ in range(n)], [[0.0] * 3 for _ in range(n)]
    grips, pulled = [[0.0] * 3 for _ in scene.pair_of], [[0.0] * 3 for _ in scene.pairs]
    shift, carry = ([0.0] * (scene.mechanism.nv if some else 0) for some in (scene.rebounds, scene.loops))
    pulls, efforts = [0.0] * len(scene.rows), [0.0] * len(drives)
    slack, towing = [0.0] * len(dry), nothing(scene.carriers)
    return Stance(
        anchors, grips, slack, 0.0, shift, carry, pushes, pulled, efforts, pulls, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, towing
    )


def rubbing(mechanism: Mechanism) -> list[int]:
    """Coordinates with dry friction."""
    return [s for s, friction in enumerate(mechanism.friction) if friction > 0.0]
