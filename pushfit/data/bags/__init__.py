"""Recordings in ROS bags."""
