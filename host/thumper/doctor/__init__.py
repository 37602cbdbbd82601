"""What `thumper doctor` measures, and what it makes of it."""
