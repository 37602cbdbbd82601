"""Costmap layers, inflation, filters, obstacle memory."""
