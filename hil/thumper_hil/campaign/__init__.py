"""Many simulated missions at once: worlds x seeds x parameter sets, one row a job."""
