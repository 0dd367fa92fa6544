"""Published tables and other programs, side by side with ours."""
