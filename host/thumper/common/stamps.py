"""Times as ROS 2 stamps: whole nanoseconds since 1970, or since the start of a simulation.

Inside, a time is a float in seconds on the host's clock, which knows no date. One whole number a session,
`epoch_ns`, lies between the two, so that stamps go to a file and back without a rounding of their own.
"""

import time

NS_PER_S = 1_000_000_000


def epoch_ns_at(now_s: float) -> int:
    """`epoch_ns` for a host's clock that shows `now_s` now."""
    return time.time_ns() - stamp_ns(now_s, 0)


def stamp_ns(time_s: float, epoch_ns: int) -> int:
    """Host's clock to stamp."""
    return round(time_s * NS_PER_S) + epoch_ns


def host_time_s(stamp: int, epoch_ns: int) -> float:
    """Stamp [ns] to the host's clock."""
    return (stamp - epoch_ns) / NS_PER_S


def rounded_s(time_s: float) -> float:
    """The time as it comes back from a stamp."""
    return host_time_s(stamp_ns(time_s, 0), 0)
