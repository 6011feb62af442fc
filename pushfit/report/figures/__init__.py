"""Figures: functions from arrays to matplotlib figures, and those of a result."""
