"""Tables with one row per push."""
