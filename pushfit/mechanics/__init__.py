"""What the model is made of: contacts, equilibria, directions, branch points."""
