"""How high the pushes are, and how sure that is."""
