"""From recordings to peak heights: files, pushes, plans, tables, simulation."""
