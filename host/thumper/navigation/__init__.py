"""From pose, map and scan to a twist: costmap, planner, controller, collision monitor, recoveries.

The runtime needs `navigator.Navigator`, `options.NavigationOptions`, `footprint.Footprint`, `goal.Goal`,
`validate.validate_goal` and `warm.warm_up`. Nothing is imported here, so that `--help` need not load numba.
"""
