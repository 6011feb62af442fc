"""What makes pushes and feels: the protocol, a simulated hand, and ROS 1."""
