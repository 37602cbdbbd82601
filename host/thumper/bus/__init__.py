"""The bus: what the robot makes goes out, what may be asked of it comes in, over Zenoh."""
