"""What the model is made of: contacts, equilibria, directions, branch points.

Units are SI, angles in radians. Which mechanics there are, by name, is in
`pushfit.mechanics.registry`.
"""
