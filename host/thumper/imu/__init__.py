"""Gyroscopes: drivers, samples and options."""
