"""Synthetic observations: a building's own equations, seen by accelerometers."""
