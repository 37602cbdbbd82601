"""The graph mapper: submaps, loop closure, optimisation."""
