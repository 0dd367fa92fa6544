"""The benchmark `all`: figures of a fixed set of runs beside those of a reference file."""
