"""Which push next, and when to stop."""
