"""From a log to a motor's parameters and how sure they are."""
