"""Scan in, corrected pose and occupancy grid out."""
