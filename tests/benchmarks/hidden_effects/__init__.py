"""What the effect finder makes of effects that were put into simulated data."""
