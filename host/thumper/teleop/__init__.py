"""Manual driving by keyboard or gamepad."""
