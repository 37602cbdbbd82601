"""Tilt and impact from the accelerometer's readings, against float64."""

import ctypes
import math
import random

import pytest

from tests.firmware.core.host_interface import HostInterface
from thumper.board import messages as m

COUNT_PER_V = 51.2
ZERO = 84  # 1.65 V
LEVEL = (ZERO, ZERO, ZERO + 41)  # 0.8 V per g
READINGS = 100  # 0.3 s
HALF_G, QUARTER_V = round(0.4 * COUNT_PER_V), round(0.25 * COUNT_PER_V)


def step(core: ctypes.CDLL, monitor: int, reading: tuple[int, int, int], tilt: int, impact: int) -> m.Fault:
    return m.Fault(core.acceleration_step(monitor, *reading, tilt, impact))


@pytest.mark.parametrize("limit", [-76, -20, -1, 0, 1, 20, 76])
def test_each_reading_of_z_with_either_sign(core: ctypes.CDLL, limit: int) -> None:
    """From the 100th tilted reading on."""
    for z in range(256):
        monitor = core.acceleration_new()
        tilted = z - ZERO < limit if limit > 0 else -(z - ZERO) < -limit if limit < 0 else False
        for number in range(1, READINGS + 3):
            expected = m.Fault.TILTED if tilted and number >= READINGS else m.Fault.NONE
            assert step(core, monitor, (ZERO, ZERO, z), limit, 0) is expected


@pytest.mark.parametrize("share", [0.3, 0.45, 0.7])
def test_vibration_neither_stops_the_robot_nor_delays_the_stop(core: ctypes.CDLL, share: float) -> None:
    """A counter goes up with a tilted reading, and down with a level one."""
    numbers, monitor, count = random.Random(3), core.acceleration_new(), 0
    seen = set()
    for _ in range(5000):
        tilted = numbers.random() < share
        count = min(count + 1, READINGS) if tilted else max(count - 1, 0)
        reading = (ZERO, ZERO, ZERO + numbers.randrange(-80, HALF_G) if tilted else ZERO + HALF_G)
        fault = step(core, monitor, reading, HALF_G, 0)
        assert fault is (m.Fault.TILTED if count == READINGS else m.Fault.NONE)
        seen.add(fault)
    assert (m.Fault.TILTED in seen) is (share > 0.5)


@pytest.mark.parametrize("limit", [1, 5, 13, 100, 154])
def test_an_impact_is_a_change_of_the_vector(core: ctypes.CDLL, limit: int) -> None:
    numbers, monitor = random.Random(4), core.acceleration_new()
    last, seen = LEVEL, set()
    step(core, monitor, last, 0, limit)
    for _ in range(5000):
        spread = numbers.choice([limit // 2 + 1, limit, 255])
        reading = tuple(min(max(value + numbers.randint(-spread, spread), 5), 255) for value in LEVEL)
        fault = step(core, monitor, (reading[0], reading[1], reading[2]), 0, limit)
        assert fault is (m.Fault.IMPACT if math.dist(reading, last) > limit else m.Fault.NONE)
        last = (reading[0], reading[1], reading[2])
        seen.add(fault)
    assert len(seen) == 2


def test_the_first_reading_is_no_impact(core: ctypes.CDLL) -> None:
    monitor = core.acceleration_new()
    assert step(core, monitor, (200, 0, 0), 0, 1) is m.Fault.NONE, "z is unknown"
    assert step(core, monitor, (0, 0, 1), 0, 1) is m.Fault.NONE, "still the first one"
    assert step(core, monitor, (0, 0, 3), 0, 1) is m.Fault.IMPACT
    for reading in ((0, 0, 255), (255, 255, 5)):
        assert step(core, monitor, reading, 0, 0) is m.Fault.NONE, "no limit"


def feed(host: HostInterface, core: ctypes.CDLL, reading: tuple[int, int, int], times: int = 1) -> None:
    for _ in range(times):
        core.host_acceleration(host.handle, *reading)


def limited(core: ctypes.CDLL, *, armed: bool) -> HostInterface:
    host = HostInterface(core)
    assert host.set("tilt_limit", HALF_G) is m.AckStatus.OK
    assert host.set("impact_limit", QUARTER_V) is m.AckStatus.OK
    core.host_take_change(host.handle)
    feed(host, core, LEVEL, 10)
    if armed:
        assert host.command(m.Command.ARM) is m.AckStatus.OK
    return host


@pytest.mark.parametrize("fault", [m.Fault.TILTED, m.Fault.IMPACT])
def test_both_stop_the_motors_and_stay_latched(core: ctypes.CDLL, fault: m.Fault) -> None:
    host = limited(core, armed=True)
    if fault is m.Fault.IMPACT:
        feed(host, core, (LEVEL[0] - QUARTER_V - 1, *LEVEL[1:]))
    else:
        for tilt in range(1, LEVEL[2] - ZERO + 1):  # slowly, so that it is no impact
            feed(host, core, (ZERO, ZERO, LEVEL[2] - tilt))
        assert host.status()[1] is m.Fault.NONE
        feed(host, core, (ZERO, ZERO, ZERO), READINGS)
    assert host.status()[:2] == (m.State.FAULT, fault)
    feed(host, core, LEVEL, 2 * READINGS)
    assert host.status()[:2] == (m.State.FAULT, fault), "latched"
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    feed(host, core, LEVEL)
    assert host.status()[1] is m.Fault.NONE


def test_a_disarmed_robot_may_be_carried_but_not_driven_on_its_side(core: ctypes.CDLL) -> None:
    host = limited(core, armed=False)
    feed(host, core, (ZERO + 41, ZERO, ZERO), READINGS)
    assert host.status()[:2] == (m.State.DISARMED, m.Fault.NONE)
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    feed(host, core, (ZERO + 41, ZERO, ZERO))
    assert host.status()[:2] == (m.State.FAULT, m.Fault.TILTED)


def test_a_change_of_parameters_begins_a_new_series(core: ctypes.CDLL) -> None:
    """The readings stop while both limits are 0, so the last one may be old. While armed nothing restarts."""
    host = limited(core, armed=False)
    host.set("impact_limit", QUARTER_V)
    core.host_take_change(host.handle)
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    feed(host, core, (255, 255, 255))
    assert host.status()[1] is m.Fault.NONE
    host.set("kp", 100)
    core.host_take_change(host.handle)
    feed(host, core, LEVEL)
    assert host.status()[1] is m.Fault.IMPACT


def test_no_limit_no_fault(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    for number in range(300):
        feed(host, core, (number % 256, 255 - number % 256, 5 + number % 2 * 250))
    assert host.status()[:2] == (m.State.CLOSED_LOOP, m.Fault.NONE)


def test_a_board_without_it_refuses_limits(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.handle = core.host_new_nano(core.eeprom_new())
    for name in ("tilt_limit", "impact_limit"):
        assert host.set(name, 1) is m.AckStatus.NO_ACCELEROMETER
        assert host.set(name, 0) is m.AckStatus.OK
    assert host.set("kp", 1) is m.AckStatus.OK
