"""Identify a motor from its logs: model parameters, their uncertainty, and checks."""
