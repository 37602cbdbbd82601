"""ROS 2 time stamps: whole nanoseconds since 1970, or since the start of a simulation.

Inside the program a time is a float in seconds on the host's clock, which has no date. One integer per
session, `epoch_ns`, links the two, so that a stamp survives a round trip through a file without rounding.
"""

import time

NS_PER_S = 1_000_000_000


def epoch_ns_at(now_s: float) -> int:
    """Return `epoch_ns` of a host clock that reads `now_s` now."""
    return time.time_ns() - stamp_ns(now_s, 0)


def stamp_ns(time_s: float, epoch_ns: int) -> int:
    """Convert a host time [s] to a stamp [ns]."""
    return round(time_s * NS_PER_S) + epoch_ns


def host_time_s(stamp: int, epoch_ns: int) -> float:
    """Convert a stamp [ns] to a host time [s]."""
    return (stamp - epoch_ns) / NS_PER_S


def rounded_s(time_s: float) -> float:
    """Return the time [s] rounded to whole nanoseconds, as it comes back from a stamp."""
    return host_time_s(stamp_ns(time_s, 0), 0)
