"""Encoder counts to pose; pose buffer, slip and jump detection."""
