"""Simulate Slamtec's RPLIDAR A1M8, A2M8 and C1M1.

Data sheets: A1M8 and A2M8 4000 points per second in express and 2000 in standard scans, at 5.5 and 10 turns
per second, 0.15 to 12 m, accuracy 1 % up to 3 m and more beyond, resolution 1 % of the range. C1M1 5000
points, 10 turns, 0.05 to 12 m, accuracy 30 mm, resolution 15 mm. The bounds are taken as three sigma. The
speed of the A1's motor is not controlled; its spread of 5 % is assumed. The data sheets have no figure for
drop-outs, so there are none: every target in range returns an echo, unless `effects/` takes it away.
"""

import struct
from dataclasses import replace
from functools import reduce
from operator import xor

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.lidars.a5_device import A5Device, A5Stream, Figures, reply

LEGACY, EXPRESS, DENSE = 0x81, 0x82, 0x85
SAMPLE_RATE_TYPE, BOARD_FLAG_TYPE, CONFIGURATION_TYPE = 0x15, 0xFF, 0x20
EXPRESS_MODE = 1
FAR_LEAD_DEG, LEAD_DEG_M = 8.0, np.rad2deg(0.0240)  # the laser passes the axis at 24 mm (SDK, triangulation)
QUALITY = 47


class Rplidar(A5Device):
    """What the models have in common: requests, standard scans and the frame of a capsule."""

    stop_commands = frozenset({0x25})
    reset_command = 0x40
    info_command = 0x50
    health_commands = frozenset({0x52})
    express_kind = EXPRESS
    express_points = 32
    points_per_s = 2000.0, 4000.0  # of standard and express scans
    has_motor_command = False

    def scan_kind(self, command: int, payload: bytes) -> A5Stream | None:
        """Start a standard scan, also if forced, or an express scan, by its number or as old hosts do."""
        if command in {0x20, 0x21}:
            self.packet_points = 16
            return A5Stream(kind=LEGACY, points_per_s=self.points_per_s[0], requested_s=self._now_s)
        if command == 0x82 and len(payload) == 5 and payload[0] in {0, EXPRESS_MODE}:
            self.packet_points = self.express_points
            return A5Stream(
                kind=self.express_kind, points_per_s=self.points_per_s[1], requested_s=self._now_s
            )
        return None

    def announcement(self, kind: int) -> bytes:
        """Return the descriptor with the size of a packet."""
        return reply(kind, b"", streams=True, length=5 if kind == LEGACY else 84)

    def answer(self, command: int, payload: bytes) -> bytes:
        """Answer sample rate and accessory board, and obey the motor's command."""
        if command == 0x59:
            return reply(
                SAMPLE_RATE_TYPE, struct.pack("<HH", *(round(1e6 / rate) for rate in self.points_per_s))
            )
        if command == 0x84 and len(payload) >= 4:
            return self._configuration(*struct.unpack("<IH", payload[:6].ljust(6, b"\0")))
        if command == 0xFF:
            return reply(BOARD_FLAG_TYPE, struct.pack("<I", self.has_motor_command))
        if command == 0xF0 and self.has_motor_command:
            self._pwm_runs = payload != b"\0\0"
            self._update_motor()
        return b""

    def _configuration(self, kind: int, mode: int) -> bytes:
        """Answer what a scan mode is, as the SDK asks before each scan."""
        values = {
            0x01: struct.pack("<HH", round(60 * self.figures.turns_per_s), 660),
            0x70: struct.pack("<H", 2),
            0x71: struct.pack("<I", round(256e6 / self.points_per_s[mode == EXPRESS_MODE])),
            0x74: struct.pack("<I", round(256 * self.figures.range_max_m)),
            0x75: bytes((self.express_kind if mode == EXPRESS_MODE else LEGACY,)),
            0x7C: struct.pack("<H", EXPRESS_MODE),
            0x7F: b"Express\0" if mode == EXPRESS_MODE else b"Standard\0",
        }
        return reply(CONFIGURATION_TYPE, struct.pack("<I", kind) + values[kind]) if kind in values else b""

    def turned_deg(self, ranges_m: FloatArray) -> FloatArray:
        """Return the lead, in the steps that a capsule can hold."""
        if self.express_kind == DENSE:
            return np.zeros(ranges_m.size)
        lead_deg = FAR_LEAD_DEG - LEAD_DEG_M / np.maximum(ranges_m, 0.05)
        return np.asarray(-np.clip(np.round(8.0 * lead_deg), 0.0, 63.0) / 8.0, np.float64)

    def burst_bytes(self, kind: int, packet: bytes) -> int:
        """Return 5 for nodes, which are sent one by one."""
        return 5 if kind == LEGACY else len(packet)

    def pack(self, kind: int, head_deg: FloatArray, angles_deg: FloatArray, ranges_m: FloatArray) -> bytes:
        """Return 16 nodes or a capsule."""
        if kind == LEGACY:
            return b"".join(map(_node, angles_deg, ranges_m, self._is_first(head_deg)))
        mm = np.rint(1e3 * ranges_m).astype(int)
        if kind == DENSE:
            body = mm.astype("<u2").tobytes()
        else:
            lead = np.rint(8.0 * (head_deg - angles_deg)).astype(int)
            cabins = zip(mm[::2], lead[::2], mm[1::2], lead[1::2], strict=True)
            body = b"".join(
                struct.pack("<HHB", a << 2 | la >> 4, b << 2 | lb >> 4, (lb & 15) << 4 | la & 15)
                for a, la, b, lb in cabins
            )
        is_new = self._stream is not None and self._stream.packets == 0
        content = struct.pack("<H", round(64.0 * head_deg[0]) % 23_040 | is_new << 15) + body
        check = reduce(xor, content)
        return bytes((0xA0 | check & 15, 0x50 | check >> 4)) + content

    def _is_first(self, head_deg: FloatArray) -> list[bool]:
        turns = np.floor(head_deg / 360.0)
        return list(np.diff(turns, prepend=turns[0]) > 0)


def _node(angle_deg: float, range_m: float, is_first: bool) -> bytes:
    quality = QUALITY if range_m > 0.0 else 0
    angle_q6 = round(64.0 * angle_deg) % 23_040
    flags = quality << 2 | (1 if is_first else 2)
    return struct.pack("<BHH", flags, angle_q6 << 1 | 1, round(4e3 * range_m))


class RplidarA1(Rplidar):
    """RPLIDAR A1M8: the adapter's DTR stops the motor."""

    figures = Figures(
        baud=115_200,
        model=0x18,
        firmware=(1, 29),
        hardware=7,
        turns_per_s=5.5,
        turns_spread=0.05,
        has_speed_control=False,
        range_min_m=0.15,
        range_max_m=12.0,
        bias_m=0.0005,
        bias_share=0.01 / 3,
        noise_m=0.0005,
        noise_per_m=0.00055,
        motor_dtr=False,
    )


class RplidarA2(Rplidar):
    """RPLIDAR A2M8 on its accessory board, which starts the motor by a command."""

    has_motor_command = True
    motor_starts_on = False
    figures = replace(
        RplidarA1.figures,
        model=0x28,
        hardware=5,
        turns_per_s=10.0,
        turns_spread=0.02,
        has_speed_control=True,
        motor_dtr=None,
    )


class RplidarC1(Rplidar):
    """RPLIDAR C1M1: measures the time of flight and turns while it scans."""

    express_kind = DENSE
    express_points = 40
    points_per_s = 5000.0, 5000.0
    figures = Figures(
        baud=460_800,
        model=0x41,
        firmware=(1, 2),
        hardware=18,
        turns_per_s=10.0,
        turns_spread=0.005,
        has_speed_control=True,
        range_min_m=0.05,
        range_max_m=12.0,
        bias_m=0.010,
        bias_share=0.0,
        noise_m=0.005,
        noise_per_m=0.0,
        motor_dtr=None,
        turns_only_in_scans=True,
    )
