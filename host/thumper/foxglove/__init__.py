"""The robot live in Foxglove: topics, description and commands."""
