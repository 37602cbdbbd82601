"""GPS: drivers, fixes, and their fusion with the odometry."""
