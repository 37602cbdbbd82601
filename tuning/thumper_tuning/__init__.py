"""Identify the drive motors, design the wheel-speed controller, and verify it on the robot."""
