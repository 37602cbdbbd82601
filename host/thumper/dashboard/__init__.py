"""The operator page: a process of its own, a client of the bus."""
