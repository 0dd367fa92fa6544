"""Two states of a building compared: what changed, and how often nothing that did."""
