"""A recording looked at before it is analysed: which humps are pushes, and where to."""
