"""AMCL: the pose in a known map."""
