"""What the data alone say: least squares, modes and likelihood sets."""
