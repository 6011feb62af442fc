"""Whether the table, the model and its mechanics fit each other: tests of them."""
