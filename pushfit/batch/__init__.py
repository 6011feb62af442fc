"""Many recordings or tables in one go; each result stands alone."""
