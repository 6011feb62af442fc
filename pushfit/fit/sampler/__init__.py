"""Draws from the posterior by emcee, run until they may be believed."""
