"""The host computer's time: computing, waking up and USB take simulated time.

The thread that reads and writes a port is the robot's control loop. Its CPU time between two calls of the
simulator, times a factor, passes in the simulation before the second call takes effect. So a slow cycle sends
its command late and finds several scans waiting, as on real hardware. Threads beside the loop are not
counted. CPU time is in units of this computer at its fastest (`cpu_speed.py`).
"""

import threading
import time

import numpy as np

from thumper_hil.effects.cpu_speed import CpuSpeed
from thumper_hil.effects.preset import HostEffects

MIN_CHARGE_S = 5e-4
"""Shorter computing is added to the next call: many short calls make a busy loop no slower."""


class HostTime:
    """Counts the CPU time outside the simulator and draws the delays of waking up."""

    def __init__(self, effects: HostEffects, seed: int) -> None:
        self._effects = effects
        self._rng = np.random.default_rng([seed, 0x405])
        self._left_at_s: float | None = None
        self._owed_s = 0.0
        self._speed = CpuSpeed() if effects.cpu_factor else None
        self._loop_thread = 0  # the thread that read last
        self.charged_s = 0.0

    @property
    def counts(self) -> bool:
        """Whether computing takes simulated time."""
        return self._effects.cpu_factor > 0.0

    def entered(self, *, reads: bool = False) -> float:
        """Return the simulated time [s] that the host has computed since `left`; 0 while it is short."""
        if not self.counts:
            return 0.0
        if reads and self._loop_thread != threading.get_ident():
            self._loop_thread, self._left_at_s = threading.get_ident(), None
        if self._left_at_s is None or self._loop_thread != threading.get_ident():
            return 0.0
        computed_s = time.thread_time() - self._left_at_s
        if self._speed is not None:
            computed_s *= self._speed.ratio(time.monotonic())
        self._owed_s += computed_s * self._effects.cpu_factor
        self._left_at_s = None
        if self._owed_s < MIN_CHARGE_S:
            return 0.0
        charge_s, self._owed_s = self._owed_s, 0.0
        self.charged_s += charge_s
        return charge_s

    def left(self) -> None:
        """Note that the host computes from now on."""
        if self.counts and self._loop_thread == threading.get_ident():
            self._left_at_s = time.thread_time()

    def wake_up_s(self) -> float:
        """Draw the delay [s] between the arrival of bytes and the program that waits for them."""
        given = self._effects
        if given.wake_up_s == given.usb_latency_s == given.hiccup_share == 0.0:
            return 0.0
        delay_s = self._rng.exponential(given.wake_up_s) + self._rng.uniform(0.0, given.usb_latency_s)
        if self._rng.random() < given.hiccup_share:
            delay_s += given.hiccup_s
        return float(delay_s)
