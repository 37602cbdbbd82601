"""What clients request: queue, handler, board jobs, experiments."""
