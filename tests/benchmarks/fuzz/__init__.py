"""The benchmark `fuzz`: mutated files for every reader."""
