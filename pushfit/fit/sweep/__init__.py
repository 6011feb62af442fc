"""The engine: a posterior as one sweep over ln tan θ_c, the rest integrated out."""
