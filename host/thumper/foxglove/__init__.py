"""The robot live in Foxglove: its topics, its description, commands from the panels."""
