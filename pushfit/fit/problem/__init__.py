"""The question that a table poses: data, priors, noise and coordinates, as arrays."""
