"""GPS: drivers, fixes, the local tangent plane and the fusion with the odometry."""
