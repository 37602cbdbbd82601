"""Faults on demand: one name and one value each, the same in a call and in a scenario's line."""
