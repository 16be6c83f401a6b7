"""Closed loops: their rows, the linear system that they make with a tree, and what users call."""
