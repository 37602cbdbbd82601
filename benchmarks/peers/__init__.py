"""Other projects' code, run beside ours in one process on one machine."""
