"""MCAP recordings: write, repair, replay, export."""
