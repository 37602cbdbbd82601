"""Readers of public robot logs."""
