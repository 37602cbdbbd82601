"""The motor board: wire protocol, driver, flashing."""
