"""The occupancy grid: its files, edits and pictures."""
