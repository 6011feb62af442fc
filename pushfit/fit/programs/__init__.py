"""Programs: functions compiled once, and where their machine code is kept."""
