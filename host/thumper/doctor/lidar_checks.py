"""Checks of the lidar: link, scan stream and share of valid beams."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from thumper.common.errors import ThumperError
from thumper.doctor.check import Check
from thumper.doctor.verdicts import (
    LIDAR_JITTER_FAIL_S,
    LIDAR_JITTER_WARN_S,
    LIDAR_ROUND_TRIP_FAIL_S,
    LIDAR_ROUND_TRIP_WARN_S,
    Limits,
    Stream,
    judge_round_trip,
    judge_stream,
    measure_round_trips,
)
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper.lidar.urg04lx import Urg04LxDriver

EXPECTED_HZ = 10.0
SCAN_TIMEOUT_S = 2.0
RETURN_SHARE_WARN = 0.2


def check_lidar(config: LidarOptions, *, seconds: float) -> Iterator[Check]:
    """Check the link, the scan stream and the share of beams with a return."""
    try:
        lidar = open_lidar(replace(config, upside_down=False))  # the mounting does not matter here
    except ThumperError as error:
        yield Check(verdict="fail", what="lidar", fix=str(error))
        return
    try:
        if isinstance(lidar, Urg04LxDriver):  # the LD19 takes no requests
            trips_s, lost = measure_round_trips(lidar.round_trip_s)
            yield judge_round_trip("lidar", trips_s, lost, LIDAR_ROUND_TRIP_WARN_S, LIDAR_ROUND_TRIP_FAIL_S)
        lidar.wait_for_scan(SCAN_TIMEOUT_S)
        damaged = lidar.counters.bad_replies
        scans, arrivals_s = [], []
        for _ in range(max(3, round(seconds * EXPECTED_HZ))):
            scans.append(lidar.wait_for_scan(SCAN_TIMEOUT_S))
            arrivals_s.append(lidar.now_s())
        stream = Stream(
            times_s=np.array([scan.time_s for scan in scans]),
            arrivals_s=np.array(arrivals_s),
            expected_Hz=EXPECTED_HZ,
            damaged=lidar.counters.bad_replies - damaged,
        )
        jitter = Limits(warn_s=LIDAR_JITTER_WARN_S, fail_s=LIDAR_JITTER_FAIL_S)
        yield from judge_stream("scans", stream, jitter)
        share = float(np.mean([np.isfinite(scan.ranges_m).mean() for scan in scans]))
        yield Check(
            verdict="warn" if share < RETURN_SHARE_WARN else "pass",
            what=f"lidar {config.port}: {scans[-1].ranges_m.size} beams, {100 * share:.0f} % with a return",
            fix="is its window covered, or is the room larger than its range?"
            if share < RETURN_SHARE_WARN
            else "",
        )
    except ThumperError as error:
        yield Check(verdict="fail", what="lidar", fix=str(error))
    finally:
        lidar.close()
