"""What the model is made of: contacts, equilibria, directions, branch points.

Which mechanics there are, by name, is in `pushfit.mechanics.registry`.
"""
