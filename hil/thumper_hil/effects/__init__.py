"""Disturbances of real hardware as plain functions, and the presets that say how strong they are."""
