"""Simulate a YDLIDAR X4.

Data sheet: 5000 points per second, 7 turns per second, 0.12 to 10 m, error 2 cm up to 1 m and 3.5 % beyond,
taken as three sigma. The noise is assumed as that of the RPLIDAR A1, which measures in the same way, and so
is the spread of the motor's speed. There is no figure for drop-outs, so there are none.
"""

import math
import struct
from functools import reduce
from operator import xor

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.lidars.a5_device import A5Device, A5Stream, Figures, reply

MEASUREMENT = 0x81
MAX_POINTS = 40


class YdlidarX4(A5Device):
    """YDLIDAR X4: the adapter's DTR starts the motor."""

    stop_commands = frozenset({0x00, 0x65})
    reset_command = 0x80
    info_command = 0x90
    health_commands = frozenset({0x91, 0x92})
    packet_points = MAX_POINTS
    figures = Figures(
        baud=128_000,
        model=6,
        firmware=(1, 10),
        hardware=1,
        turns_per_s=7.0,
        turns_spread=0.05,
        has_speed_control=False,
        range_min_m=0.12,
        range_max_m=10.0,
        bias_m=0.02 / 3,
        bias_share=0.035 / 3,
        noise_m=0.001,
        noise_per_m=0.00055,
        motor_dtr=True,
    )

    def scan_kind(self, command: int, payload: bytes) -> A5Stream | None:
        """Start a scan, also if forced."""
        if command not in {0x60, 0x61}:
            return None
        return A5Stream(kind=MEASUREMENT, points_per_s=5000.0, requested_s=self._now_s)

    def announcement(self, kind: int) -> bytes:
        """Return the descriptor; its length of 5 has no meaning."""
        return reply(kind, b"", streams=True, length=5)

    def answer(self, command: int, payload: bytes) -> bytes:
        """Answer nothing else."""
        return b""

    def points_in_packet(self, stream: A5Stream, first_s: float) -> int:
        """Return 1 for the packet that starts a turn, else up to 40 points of the same turn."""
        numbers = stream.points + np.arange(MAX_POINTS)
        turns = np.floor(
            self.head_deg(self._time_s(stream, np.append(numbers[0] - 1, numbers), first_s)) / 360.0
        )
        if turns[1] > turns[0]:
            return 1
        return int(np.count_nonzero(turns[1:] == turns[0]))

    def turned_deg(self, ranges_m: FloatArray) -> FloatArray:
        """Return the correction of the manual, with which the host will find the true angle."""
        return np.array([_correction_deg(1e3 * range_m) for range_m in ranges_m])

    def pack(self, kind: int, head_deg: FloatArray, angles_deg: FloatArray, ranges_m: FloatArray) -> bytes:
        """Return the packet of up to 40 points; its checksum is the XOR of its words."""
        first, last = (round(64.0 * angle) % 23_040 << 1 | 1 for angle in (head_deg[0], head_deg[-1]))
        starts_turn = head_deg.size == 1
        samples = np.rint(4e3 * ranges_m).astype("<u2")
        words = [0x55AA, head_deg.size << 8 | starts_turn, first, last, *map(int, samples)]
        return struct.pack("<5H", *words[:4], reduce(xor, words)) + samples.tobytes()


def _correction_deg(mm: float) -> float:
    if mm <= 0.0:
        return 0.0
    return math.degrees(math.atan(21.8 * (155.3 - mm) / (155.3 * mm)))
