"""Recursions over the tree, one a file, and the public functions that run them."""
