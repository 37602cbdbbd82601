"""Who moves the wheels: drive manager, twist mux, heartbeats."""
