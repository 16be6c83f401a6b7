"""Ground, and what of a rig may touch it."""
