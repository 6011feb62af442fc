"""A table through every question, in order; and many of them."""
