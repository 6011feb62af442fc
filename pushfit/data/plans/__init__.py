"""The plan of an exploration, and which push is which."""
