"""Global planners, their searches, replanning, exploration."""
