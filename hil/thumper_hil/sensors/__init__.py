"""Simulated sensors beside the lidars, on serial lines of their own."""
