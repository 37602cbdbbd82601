"""From pose, map and scan to a twist: costmap, planner, controller, collision monitor, recoveries."""
