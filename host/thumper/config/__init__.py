"""The robot's configuration: one TOML file, checked whole before anything moves."""
