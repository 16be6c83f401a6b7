"""The semi-implicit step: contact, limits, drives, damping and friction in one solve, by articulated bodies."""
