"""Topics and commands of the robot in Foxglove."""
