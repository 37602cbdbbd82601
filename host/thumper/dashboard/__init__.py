"""The page in the browser: a process of its own that speaks to the robot over the bus alone."""
