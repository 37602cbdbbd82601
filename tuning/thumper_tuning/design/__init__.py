"""From a motor's parameters to gains, and how the loop then behaves."""
