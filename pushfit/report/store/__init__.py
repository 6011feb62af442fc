"""A result as files, and read back."""
