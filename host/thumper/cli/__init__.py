"""The `thumper` command: one subcommand per file."""
