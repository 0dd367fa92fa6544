"""The benchmark `versions`: the lowest and the highest dependencies on every Python."""
