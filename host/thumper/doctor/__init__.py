"""Checks of host, board and lidar."""
