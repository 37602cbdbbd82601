"""The robot's TOML file, checked before anything moves."""
