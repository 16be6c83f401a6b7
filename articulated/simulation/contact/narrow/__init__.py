"""Narrow phase: where two convex shapes touch, in masked code without branches. A file for each family of shapes."""
