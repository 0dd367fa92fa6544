"""The shipped example: a synthetic observation, a real ground motion, and scripts."""
