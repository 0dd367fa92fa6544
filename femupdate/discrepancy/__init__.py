"""Where simulation and measurement disagree, what is missing, and whether it closes the gap."""
