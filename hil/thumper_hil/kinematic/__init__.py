"""Kinematic arenas: walls, posts and people, a unicycle with a lidar, and drives through them."""
