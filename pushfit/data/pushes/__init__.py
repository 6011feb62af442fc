"""Where in a recording the pushes are."""
