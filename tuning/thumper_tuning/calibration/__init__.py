"""The thesis's experiments, and the calibration of the robot's geometry."""
