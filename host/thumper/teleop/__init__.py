"""Driving by hand from a keyboard or a gamepad: a client of a running robot's bus."""
