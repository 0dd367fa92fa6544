"""Element tests against published values, and speed against OpenSees."""
