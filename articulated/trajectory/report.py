"""The certificate of a run: what was checked, and whether it stayed within its tolerance."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from articulated.dynamics.swing_twist import stops_of
from articulated.rig import Joint, Rig

if TYPE_CHECKING:
    from articulated.trajectory.trajectory import Trajectory

ENERGY_TOLERANCE = 1e-2
"""Energy may drift by this part of the energy that was exchanged."""

NORM_TOLERANCE = 1e-9

PENETRATION = 1e-2
"""How deep a point may be in what it touches [m]: an impact of some metres a second on the default material."""

RESIDUAL = 1e3
"""The solver may miss its tolerance in a step by this factor: an impact that it did not get to the end of."""

GAP = 1e-5
"""How far a loop may be open [m, rad]."""

_DEEP = "it started inside the ground or another body, or these are soft: raise their stiffness, or move the start"
_UNSOLVED = "an impact was not solved to the end: take a smaller dt"


class Outcome(enum.IntEnum):
    """How the run of one state ended."""

    COMPLETED = 0
    DIVERGED = 1
    STEP_TOO_SMALL = 2
    STEP_LIMIT = 3

    @property
    def remedy(self) -> str:
        """What to do about it; "" if nothing is wrong."""
        return _REMEDIES[self]

    @property
    def label(self) -> str:
        """Its name in a sentence."""
        return self.name.lower().replace("_", " ")


_REMEDIES = {
    Outcome.COMPLETED: "",
    Outcome.DIVERGED: "the numbers overflowed: take a smaller dt or integrator='dopri5', or give light joints armature",
    Outcome.STEP_TOO_SMALL: "no step was short enough: give light joints armature, above all where axes may coincide",
    Outcome.STEP_LIMIT: "max_steps was reached before the end: raise it, or loosen rtol and atol",
}


@dataclass(frozen=True)
class Check:
    """One measured quantity of a run.

    Attributes:
        name, unit: what it is.
        value: the worst of all states and frames.
        tolerance: what is allowed; infinite if a run is not judged by it.
        remedy: what to do if it is more.
    """

    name: str
    value: float
    tolerance: float
    unit: str
    remedy: str

    @property
    def passed(self) -> bool:
        return self.value <= self.tolerance  # False for NaN


@dataclass(frozen=True)
class Report:
    """The certificate of a run; true if every state completed and every check passed.

    Attributes:
        checks: what was measured.
        outcomes: how many states ended in which way.
    """

    checks: tuple[Check, ...]
    outcomes: dict[Outcome, int]

    def __bool__(self) -> bool:
        return self.passed

    @property
    def passed(self) -> bool:
        completed = all(outcome is Outcome.COMPLETED for outcome in self.outcomes)
        return completed and all(check.passed for check in self.checks)

    def __getitem__(self, name: str) -> Check:
        """The check with this name."""
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(f"no check {name!r}; there are {', '.join(repr(check.name) for check in self.checks)}")

    def __str__(self) -> str:
        lines = [f"{'passed' if self.passed else 'NOT PASSED'}"]
        for outcome, count in self.outcomes.items():
            text = f"  {count} state{'s' if count > 1 else ''} {outcome.label}"
            lines.append(text + (f": {outcome.remedy}" if outcome.remedy else ""))
        for check in self.checks:
            limit = f"allowed {check.tolerance:.3g}" if np.isfinite(check.tolerance) else "not judged"
            verdict = "" if check.passed else f"  <- {check.remedy}"
            lines.append(f"  {check.name:<18} {check.value:10.3g} {check.unit:<9} {limit}{verdict}")
        return "\n".join(lines)


@np.errstate(invalid="ignore", over="ignore")  # what diverged is infinite or NaN, and no check of it passes
def certify(run: Trajectory) -> Report:
    """The certificate of a run."""
    counts = {outcome: int(np.count_nonzero(run.outcome == outcome)) for outcome in Outcome}
    drift = _energy_drift(run.kinetic_energy, run.potential_energy, run.work)
    checks = [
        Check("energy drift", drift, ENERGY_TOLERANCE, "relative", "take a smaller dt, or integrator='rk4' or 'dopri5'"),
        Check("quaternion norm", _norm_drift(run.rig, run.q), NORM_TOLERANCE, "", "report this as a bug"),
        Check("limit violation", _limit_violation(run.rig, run.q), np.inf, "rad or m", ""),
    ]
    if run.contact_links:
        checks.append(Check("penetration", float((-run.contact_gaps).max(initial=0.0)), PENETRATION, "m", _DEEP))
    if run.loop_rows:
        checks.append(_largest_gap(run))
    if (tolerance := run.settings.get("tolerance")) is not None:
        allowed = RESIDUAL * float(tolerance)
        checks.append(Check("solver residual", float(run.residual.max(initial=0.0)), allowed, "m/s", _UNSOLVED))
    return Report(tuple(checks), {outcome: count for outcome, count in counts.items() if count})


def _energy_drift(kinetic: np.ndarray, potential: np.ndarray, work: np.ndarray) -> float:
    """|E − E₀ − W|, relative to the most energy that was ever kinetic, or had changed form."""
    with np.errstate(all="ignore"):
        drift = np.abs((kinetic - kinetic[..., :1]) + (potential - potential[..., :1]) - (work - work[..., :1]))
        exchanged = np.maximum(kinetic, np.abs(potential - potential[..., :1])).max(axis=-1)
        relative = np.where(drift.max(axis=-1) == 0.0, 0.0, drift.max(axis=-1) / exchanged)
    return float(relative.max(initial=0.0))


def _largest_gap(run: Trajectory) -> Check:
    """Of all loops; and which rows are open, if any is too far. A rope is open where it is too long, by what stops give way."""
    ropes = np.array([row.endswith(": rope") for row in run.loop_rows])
    gaps = np.where(ropes, 0.0, np.abs(run.loop_gaps)).max(initial=0.0, axis=tuple(range(run.loop_gaps.ndim - 1)))
    rows = [run.loop_rows[k] for k in np.argsort(-gaps) if not gaps[k] <= GAP]
    remedy = f"these rows cannot hold together, or the steps are too long for them: {'; '.join(rows)}"
    return Check("loop gap", float(gaps.max(initial=0.0)), GAP, "m or rad", remedy)


def _norm_drift(rig: Rig, q: np.ndarray) -> float:
    worst = 0.0
    for where in rig.quaternions.values():
        worst = max(worst, float(np.abs(np.linalg.norm(q[..., where], axis=-1) - 1.0).max(initial=0.0)))
    return worst


def _limit_violation(rig: Rig, q: np.ndarray) -> float:
    joints = [joint for joint in rig.joints.values() if not joint.mimic]
    return max([0.0, *(beyond_limits(joint, q[..., joint.q_slice]) for joint in joints)])


def beyond_limits(joint: Joint, q: np.ndarray) -> float:
    """How far a joint's own configurations, shape (..., nq), pass its limits at most [rad or m]; 0 if they do not."""
    limits = joint.limits
    if joint.kind in ("planar", "floating"):
        return 0.0
    if limits.ball is not None:
        lefts = [left for _, ends in stops_of(limits.ball, list(np.moveaxis(q, -1, 0))) for _, left in ends]
        return max([0.0, *(float((-left).max(initial=0.0)) for left in lefts)])
    if joint.kind == "ball":
        turn = 2.0 * np.arctan2(np.linalg.norm(q[..., :3], axis=-1), np.abs(q[..., 3]))
        return float((turn - limits.upper).max(initial=0.0))
    return float(np.maximum(q - limits.upper, limits.lower - q).max(initial=0.0))
