"""Checks of the lidar: link, scan stream and share of valid beams."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.serial_port import open_port
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
from thumper.lidar.a5_lidar import A5Lidar
from thumper.lidar.identify import identify_lidar
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper.lidar.urg04lx import Urg04LxDriver

EXPECTED_HZ = 10.0
SCAN_TIMEOUT_S = 2.0
RETURN_SHARE_WARN = 0.2
FEW_RETURNS = (
    "in a room, its window may be covered; outdoors this is normal, but here no scan can be matched: "
    "the pose follows wheels and GPS, and a start with --map needs walls in range"
)


def _found_instead(config: LidarOptions) -> str:
    """Return which other lidar answers on the port, or an empty text."""
    try:
        with open_port(config.port, baud=115_200, name="lidar") as port:
            found = identify_lidar(port)
    except ThumperError:
        return ""
    if found is None or found[0] == config.model:
        return ""
    if not found[0]:
        return f"the lidar on {config.port} {found[1]}"
    return f'{config.port} answers as {found[1]}; set [lidar] model = "{found[0]}"'


def check_lidar(config: LidarOptions, *, seconds: float) -> Iterator[Check]:
    """Check the link, the scan stream and the share of beams with a return."""
    try:
        lidar = open_lidar(replace(config, upside_down=False))  # the mounting does not matter here
    except ThumperError as error:
        yield Check(verdict="fail", what="lidar", fix=_found_instead(config) or str(error))
        return
    try:
        holds_speed = True
        if isinstance(lidar, A5Lidar):
            yield Check(verdict="pass", what=f"{lidar.model.name}, firmware {lidar.info.firmware}")
            holds_speed = lidar.model.holds_speed
        if isinstance(lidar, Urg04LxDriver):  # the others take no requests while they scan
            trips_s, lost = measure_round_trips(lidar.round_trip_s)
            yield judge_round_trip("lidar", trips_s, lost, LIDAR_ROUND_TRIP_WARN_S, LIDAR_ROUND_TRIP_FAIL_S)
        lidar.wait_for_sample(SCAN_TIMEOUT_S)
        damaged = lidar.counters.bad_replies
        scans, arrivals_s = [], []
        for _ in range(max(3, round(seconds * EXPECTED_HZ))):
            scans.append(lidar.wait_for_sample(SCAN_TIMEOUT_S))
            arrivals_s.append(lidar.now_s())
        times_s = np.array([scan.time_s for scan in scans])
        stream = Stream(
            times_s=times_s,
            arrivals_s=np.array(arrivals_s),
            expected_Hz=EXPECTED_HZ if holds_speed else float(1.0 / np.median(np.diff(times_s))),
            damaged=lidar.counters.bad_replies - damaged,
        )
        jitter = Limits(warn_s=LIDAR_JITTER_WARN_S, fail_s=LIDAR_JITTER_FAIL_S)
        yield from judge_stream("scans", stream, jitter)
        share = float(np.mean([np.isfinite(scan.ranges_m).mean() for scan in scans]))
        yield Check(
            verdict="warn" if share < RETURN_SHARE_WARN else "pass",
            what=f"lidar {config.port}: {scans[-1].ranges_m.size} beams, {100 * share:.0f} % with a return",
            fix=FEW_RETURNS if share < RETURN_SHARE_WARN else "",
        )
    except ThumperError as error:
        yield Check(verdict="fail", what="lidar", fix=str(error))
    finally:
        lidar.close()
