"""Ways to go on from one time to another, a file for each family."""
