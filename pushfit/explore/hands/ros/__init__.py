"""A robot under ROS 1: algorithm, position and touch node on standard messages."""
