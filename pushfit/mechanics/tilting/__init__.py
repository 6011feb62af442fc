"""Tilting mechanics: an object that leans while it is pushed."""
