"""From columns to a recording: roles, units, clock, gaps."""
