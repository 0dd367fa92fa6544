"""The benchmark `memory`: what every command takes on the six-story study."""
