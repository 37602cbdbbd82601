"""Inject faults by name and value, from a call or from a scenario file."""
