"""Every product of a run in MCAP files that survive a crash; back again as messages, maps and tables."""
