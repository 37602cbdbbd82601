"""Lidars: drivers, de-skewing, checks; one `Scan` type."""
