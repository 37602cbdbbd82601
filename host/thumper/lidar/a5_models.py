"""The lidars that speak the A5 protocol: their identities, requests and motors."""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from thumper.lidar.a5_protocol import DeviceInfo, request
from thumper.lidar.point_packet import PacketDecoder
from thumper.lidar.rplidar_packets import dense_decoder, express_decoder, legacy_decoder
from thumper.lidar.ydlidar_packets import YdlidarDecoder

Motor = Literal["dtr off", "dtr on", "pwm", "own"]
"""Which state of the line DTR runs the motor; or a PWM command; or the lidar runs it itself."""

PWM_RUN = struct.pack("<H", 660)  # 10 turns per second
PWM_STOP = struct.pack("<H", 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class A5Model:
    """A model or series; the `ids` are the model bytes with which its units answer."""

    name: str
    ids: range
    baud: int
    motor: Motor
    range_min_m: float
    range_max_m: float
    info: bytes = request(0x50)
    health: bytes = request(0x52)
    reset: bytes = request(0x40)
    stop: bytes = request(0x25)
    scan: bytes = request(0x20)
    express: bytes = request(0x82, bytes(5))
    sample_rate: bytes = request(0x59)
    point_s: float | None = None  # None: the lidar is asked for it
    decoders: Mapping[int, Callable[[], PacketDecoder]] = field(
        default_factory=lambda: {0x81: legacy_decoder, 0x82: express_decoder, 0x85: dense_decoder}
    )

    @property
    def holds_speed(self) -> bool:
        """Whether the lidar controls the speed of its head; the others' depends on supply and age."""
        return self.motor == "own"

    def motor_request(self, *, run: bool) -> bytes:
        """Return the request that starts or stops the motor; empty if it needs none."""
        return request(0xF0, PWM_RUN if run else PWM_STOP) if self.motor == "pwm" else b""

    def dtr(self, *, run: bool) -> bool | None:
        """Return the state of DTR that starts or stops the motor; None if it does not matter."""
        return None if self.motor == "own" else run == (self.motor == "dtr on")


RPLIDAR_A1 = A5Model(
    name="RPLIDAR A1",
    ids=range(0x10, 0x20),
    baud=115_200,
    motor="dtr off",
    range_min_m=0.15,
    range_max_m=12.0,
)
RPLIDAR_A2 = A5Model(
    name="RPLIDAR A2",
    ids=range(0x20, 0x30),
    baud=115_200,
    motor="pwm",
    range_min_m=0.15,
    range_max_m=12.0,
)
RPLIDAR_C1 = A5Model(
    name="RPLIDAR C1",
    ids=range(0x40, 0x50),
    baud=460_800,
    motor="own",
    range_min_m=0.05,
    range_max_m=12.0,
)
YDLIDAR_X4 = A5Model(
    name="YDLIDAR X4",
    ids=range(6, 7),
    baud=128_000,
    motor="dtr on",
    range_min_m=0.12,
    range_max_m=10.0,
    info=request(0x90),
    health=request(0x91),
    reset=request(0x80),
    stop=request(0x00) + request(0x65),
    scan=request(0x60),
    express=b"",
    sample_rate=b"",
    point_s=1.0 / 5000.0,
    decoders={0x81: YdlidarDecoder},
)
A5_MODELS = {
    "rplidar_a1": RPLIDAR_A1,
    "rplidar_a2": RPLIDAR_A2,
    "rplidar_c1": RPLIDAR_C1,
    "ydlidar_x4": YDLIDAR_X4,
}


def unknown_text(info: DeviceInfo) -> str:
    """Say what a lidar answers whose model is none of `A5_MODELS`."""
    names = ", ".join(model.name for model in A5_MODELS.values())
    return (
        f"answers with model number {info.model} and firmware {info.firmware}, a model that thumper does not "
        f"know; of its family it knows {names}"
    )


def find_model(info: DeviceInfo, asked: A5Model) -> tuple[str, A5Model] | None:
    """Return option name and model of a device that answered the requests of the model `asked`."""
    for name, model in A5_MODELS.items():
        if info.model in model.ids and model.info == asked.info:
            return name, model
    return None
