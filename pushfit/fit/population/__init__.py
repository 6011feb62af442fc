"""Many tables: each as a row, and what they have in common."""
