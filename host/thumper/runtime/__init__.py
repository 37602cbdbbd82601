"""The robot's process as others see it: what may be asked of it, who goes first, and what it answers."""
