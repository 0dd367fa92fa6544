"""The catalogue: one effect in each module; every module with an `Effect` belongs to it."""
