"""Finding the robot in a map that is known."""
