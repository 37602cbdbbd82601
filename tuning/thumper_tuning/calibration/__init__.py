"""The thesis's experiments 8.1 and 8.2, and the calibration of odometry that follows from the first."""
