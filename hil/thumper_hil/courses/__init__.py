"""Courses of the navigation benchmarks, driven in the full simulator."""
