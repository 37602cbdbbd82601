"""Pose, grid and scan in, twist out.

The runtime needs `navigator.Navigator`, `options.NavigationOptions`, `footprint.Footprint`, `goal.Goal`,
`planners.goal_validation.validate_goal` and `warm_up.warm_up`. Nothing is imported here, so `--help` does not load numba.
"""
