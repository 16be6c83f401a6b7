"""Makers of the shipped rigs: a function for each, whose first line says what the rig shows."""
