"""The catalogue: one effect a module; a new module with an `Effect` in it is in the catalogue."""
