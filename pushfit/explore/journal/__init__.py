"""What an exploration keeps, so that it goes on where it was killed."""
