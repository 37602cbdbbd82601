"""Localization in a known map."""
