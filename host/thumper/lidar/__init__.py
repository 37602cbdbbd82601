"""Lidars: one `Scan` type, one driver a sensor."""
