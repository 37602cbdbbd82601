"""Assemble the points of a spinning lidar to scans of evenly spaced beams. Pure: no port, no clock.

The lidar has no clock but measures at a fixed rate: the number of a point is its time. The angles show how
many points were lost. A scan starts behind the robot, so that one sweep covers everything ahead of it.
"""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.lidar.clock import STREAM_WINDOW_S, ClockSync
from thumper.lidar.point_packet import PointPacket
from thumper.lidar.scan import Scan

SEAM_DEG, TURN_DEG = 180.0, 360.0
GAP_S = 0.25
"""If data of more than a turn is missing, the number of lost points is a guess; start again."""

MIN_SHARE = 0.5
"""Drop a turn with a smaller share of its points."""

FILTER_POINTS = 1.5
"""A point leaves the lidar that long after its middle, says Slamtec's SDK."""

SAME_SURFACE_SHARE, SAME_SURFACE_M = 0.06, 0.03
"""Neighbours that differ by less belong to one surface, up to an incidence of 80 degrees."""

NEVER_WRAPS_MS = 1 << 48


class ScanBuilder:
    """Collects packets; returns the scans that they complete."""

    def __init__(
        self,
        *,
        point_s: float,
        delay_s: float,
        gap_points: float,
        range_limits_m: tuple[float, float],
        no_return_m: float,
    ) -> None:
        """Set up for points `point_s` apart that are read at least `delay_s` after the last of a packet."""
        self._point_s = point_s
        self._delay_s = delay_s + FILTER_POINTS * point_s
        self._gap_points = gap_points
        self._limits_m = range_limits_m
        self._no_return_m = no_return_m
        self._received_s: float | None = None
        self.lost_points = 0
        self._restart()

    def _restart(self) -> None:
        self._clock = ClockSync(wrap_ms=NEVER_WRAPS_MS, least_lag_s=self._delay_s, window_s=STREAM_WINDOW_S)
        self._parts: list[FloatArray] = []
        self._is_whole = False  # false until the seam has been passed
        self._next_index, self._end_deg = 0, 0.0

    def feed(self, packets: list[PointPacket], received_s: float) -> list[Scan]:
        """Add the packets that were read at `received_s`. They may be old: a busy host reads late."""
        if packets:
            read_s = self._point_s * sum(packet.ranges_m.size for packet in packets)
            if self._received_s is not None and received_s - self._received_s - read_s > GAP_S:
                self._restart()
            self._received_s = received_s
        scans = [self._add(packet, received_s) for packet in packets]
        return [scan for scan in scans if scan is not None]

    def _add(self, packet: PointPacket, received_s: float) -> Scan | None:
        points, step_deg = packet.ranges_m.size, packet.step_deg
        start_deg = (packet.start_deg - SEAM_DEG) % TURN_DEG
        if self._next_index > 0:
            slack_deg = max(self._gap_points, 1.0) * step_deg  # the angles may step back a little
            gap_deg = (start_deg - self._end_deg + slack_deg) % TURN_DEG - slack_deg
            lost = gap_deg / step_deg - 1.0
            if lost > self._gap_points and gap_deg < TURN_DEG / 2:
                self.lost_points += round(lost)
                self._next_index += round(lost)
            start_deg = self._end_deg + gap_deg
        order = np.arange(points)
        index = self._next_index + order
        self._next_index += points
        head_deg = start_deg + step_deg * order
        last_s = self._clock.host_time_s(round(1e3 * self._point_s * index[-1]), received_s)
        times_s = last_s - self._point_s * order[::-1]
        part = np.column_stack([index, times_s, head_deg, head_deg + packet.turned_deg, packet.ranges_m])
        self._end_deg = float(head_deg[-1])
        if self._end_deg < TURN_DEG:
            self._parts.append(part)
            return None
        self._end_deg -= TURN_DEG
        beyond = head_deg >= TURN_DEG
        self._parts.append(part[~beyond])
        scan = self._scan(np.concatenate(self._parts)) if self._is_whole else None
        self._parts, self._is_whole = [part[beyond] - (0.0, 0.0, TURN_DEG, TURN_DEG, 0.0)], True
        return scan

    def _scan(self, points: FloatArray) -> Scan | None:
        index, times_s, head_deg, angles_deg, ranges_m = points.T
        step_deg, first_deg = np.polyfit(index - index[0], head_deg, 1)
        beams = round(TURN_DEG / step_deg)
        if len(points) < MIN_SHARE * beams:
            return None
        point_s, after_s = np.polyfit(index - index[0], times_s - times_s[0], 1)
        turned_deg = float(np.median(angles_deg - head_deg))
        increment_deg = TURN_DEG / beams
        beam_0_s = times_s[0] + after_s - (first_deg + turned_deg) / step_deg * point_s
        return Scan(
            time_s=float(beam_0_s),
            ranges_m=self._resample(angles_deg, ranges_m, beams),
            angle_min_rad=np.deg2rad(TURN_DEG - SEAM_DEG),
            angle_increment_rad=-float(np.deg2rad(increment_deg)),
            time_increment_s=float(point_s * increment_deg / step_deg),
            range_min_m=self._limits_m[0],
            range_max_m=self._limits_m[1],
        )

    def _resample(self, angles_deg: FloatArray, ranges_m: FloatArray, beams: int) -> FloatArray:
        """Return the ranges of evenly spaced beams, interpolated where both neighbours see one surface."""
        angles_deg = angles_deg % TURN_DEG
        order = np.argsort(angles_deg, kind="stable")
        angles_deg, ranges_m = angles_deg[order], ranges_m[order]
        angles_deg = np.concatenate([angles_deg[-1:] - TURN_DEG, angles_deg, angles_deg[:1] + TURN_DEG])
        ranges_m = np.concatenate([ranges_m[-1:], ranges_m, ranges_m[:1]])
        step_deg = TURN_DEG / beams
        beams_deg = step_deg * np.arange(beams)
        right = np.searchsorted(angles_deg, beams_deg, side="right")
        left = right - 1
        width_deg = np.maximum(angles_deg[right] - angles_deg[left], 1e-9)
        share = (beams_deg - angles_deg[left]) / width_deg
        before_m, after_m = ranges_m[left], ranges_m[right]
        nearest_m = np.where(share < 0.5, before_m, after_m)
        nearest_m = np.where(nearest_m == 0.0, self._no_return_m, nearest_m)
        nearest_m[np.minimum(share, 1.0 - share) * width_deg > step_deg] = np.nan  # lost points
        least_m = np.minimum(before_m, after_m)
        same = np.abs(after_m - before_m) < np.maximum(SAME_SURFACE_M, SAME_SURFACE_SHARE * least_m)
        same &= (least_m > 0.0) & (width_deg < 2.0 * step_deg)
        return np.where(same, before_m + share * (after_m - before_m), nearest_m)
