"""A kinematic simulation for navigation tests: walls, posts and people, and a unicycle with a lidar."""
