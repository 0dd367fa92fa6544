"""Kinds of observation of one simulated building, alone and together."""
