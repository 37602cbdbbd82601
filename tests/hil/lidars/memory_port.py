"""A simulated lidar behind an in-memory port, for driver tests, and a stationary robot."""

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
import serial

from thumper.common.geometry import FloatArray
from thumper_hil.lidars.a5_device import A5Device
from thumper_hil.lidars.ld19 import Ld19
from thumper_hil.lidars.urg04lx import Urg04Lx

Lidar = TypeVar("Lidar", Ld19, Urg04Lx, A5Device)


class MemoryPort(Generic[Lidar]):
    """A port whose blocking read advances simulated time; `spoil` may alter the received bytes."""

    port = "memory"

    def __init__(self, lidar: Lidar) -> None:
        self.lidar: Lidar = lidar
        self.baudrate = lidar.baud or 115_200
        self.timeout = 0.02
        self.time_s = 0.0
        self.spoil: Callable[[bytes], bytes] = lambda data: data
        self.unplugged = False
        self.closed = False
        self._buffer = b""
        self.dtr = True  # as when pyserial opens a port

    def clock_s(self) -> float:
        return self.time_s

    def pass_time(self, seconds: float) -> None:
        self.time_s += seconds
        self.lidar.advance(self.time_s)
        self._buffer += self.spoil(self.lidar.read())

    @property
    def dtr(self) -> bool:
        return self._dtr

    @dtr.setter
    def dtr(self, level: bool) -> None:
        self._dtr = level
        if isinstance(self.lidar, A5Device):
            self.lidar.set_dtr(level, self.time_s)

    def write(self, data: bytes) -> int:
        if self.unplugged:
            raise serial.SerialException("gone")
        self.lidar.write(data, self.time_s)
        return len(data)

    @property
    def in_waiting(self) -> int:
        if self.unplugged:
            raise OSError("gone")
        return len(self._buffer)

    def read(self, size: int) -> bytes:
        until_s = self.time_s + self.timeout
        while len(self._buffer) < size and self.time_s < until_s:
            self.pass_time(0.001)
        data, self._buffer = self._buffer[:size], self._buffer[size:]
        return data

    def close(self) -> None:
        self.closed = True


def standing(times_s: FloatArray) -> FloatArray:
    return np.tile([0.3, -0.2, 0.5], (times_s.size, 1))
