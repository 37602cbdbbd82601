"""Controllers, goal checker, speed limiter."""
