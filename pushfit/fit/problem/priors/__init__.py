"""What is known of a parameter before, as densities and draws."""
