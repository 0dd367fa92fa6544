"""Measured events of one structure: every one predicted from every other."""
