"""Report: figures of the results and pictures of the mode shapes."""
