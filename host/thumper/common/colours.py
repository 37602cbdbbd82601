"""The colours of everything drawn: pictures, reports, and the light scheme of the pages.

The style sheets of the dashboard and of the site's robot repeat them: see `tests/dashboard/test_colours.py`.
"""

BLUE = "#1f6feb"  # the robot, what it drove, measured speed
ORANGE = "#c2410c"  # plan and goal
GREEN = "#1a7f37"  # truth of a simulation
RED = "#d1242f"  # the newest scan
PURPLE = "#a21caf"  # keep-out zones
GREY = "#57606a"  # set-point, reference
UNKNOWN_COLOUR, FREE_COLOUR, OCCUPIED_COLOUR = "#dfe5eb", "#fbfcfd", "#1b2733"  # of a map
