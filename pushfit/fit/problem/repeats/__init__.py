"""Repeated pushes: averaged, pooled, and what all heights of one repeat share."""
