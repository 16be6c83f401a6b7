"""Forces on particles, a file for each kind."""
