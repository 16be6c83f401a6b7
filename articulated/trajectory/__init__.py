"""Recorded motions, their certificates, and their files."""

from articulated.trajectory.cloud import Cloud
from articulated.trajectory.motion import Motion
from articulated.trajectory.report import Check, Outcome, Report
from articulated.trajectory.trajectory import Trajectory

__all__ = ["Check", "Cloud", "Motion", "Outcome", "Report", "Trajectory"]
