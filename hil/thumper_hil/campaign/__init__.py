"""Run many simulated missions in parallel: worlds x seeds x parameter sets, one row per job."""
