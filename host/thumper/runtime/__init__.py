"""The robot's one loop: sense, decide, act, publish."""
