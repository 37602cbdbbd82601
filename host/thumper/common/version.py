"""The version of the program and of the firmware."""

__version__ = "0.2.0"
