"""Thumper: the brain of a differential-drive robot (link, odometry, lidar, mapping, navigation)."""

__version__ = "0.1.0"
