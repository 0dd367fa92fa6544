"""Whether intervals of a frame hold the truth of another mesh or another program."""
