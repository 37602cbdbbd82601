"""The version of program and firmware."""

__version__ = "0.2.0"
