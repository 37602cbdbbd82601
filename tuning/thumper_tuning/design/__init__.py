"""Design the controller gains for a motor model, and analyze the closed loop."""
