"""Anybody's motor log, read and put in order."""
