"""Reports on a terminal and as JSON."""
