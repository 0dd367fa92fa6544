"""Our network and the published layout, trained side by side."""
