"""Experiments on a board: what is driven, recorded and written."""
