"""What is believed of a grasp, from the pushes that were told."""
