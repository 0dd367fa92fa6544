"""Twenty-four frozen tasks of missing effects, their score, and what enters."""
