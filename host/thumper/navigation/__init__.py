"""Pose, map and scan in, twist out.

The runtime needs `navigator.Navigator`, `options.NavigationOptions`, `footprint.Footprint`, `goal.Goal` and
`warm_up.warm_up`. Nothing is imported here, so that `--help` does not load numba.
"""
