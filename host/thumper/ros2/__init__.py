"""The robot as a ROS 2 node over rmw_zenoh, without ROS."""
