"""Test the host's driver against the simulated lidar, byte for byte, on simulated time."""

import math
from collections.abc import Callable, Iterator
from typing import cast

import numpy as np
import pytest
import serial

from tests.hil.lidars.memory_port import MemoryPort, standing
from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.serial_port import SerialPort
from thumper.lidar.scan import Scan
from thumper.lidar.urg04lx import Urg04LxDriver, Urg04LxOptions
from thumper_hil.lidars.urg04lx import Urg04Lx
from thumper_hil.world.world import World

POLL_S = 0.1
ROOM = World.load("lab")


def turning(rate_rad_s: float) -> Callable[[FloatArray], FloatArray]:
    def pose_at(times_s: FloatArray) -> FloatArray:
        still = np.zeros_like(times_s)
        return np.column_stack([still, still, rate_rad_s * times_s])

    return pose_at


def connect(
    pose_at: Callable[[FloatArray], FloatArray] = standing,
    *,
    world: World = ROOM,
    turn_s: float = 0.1,
    options: Urg04LxOptions | None = None,
    seed: int = 1,
) -> tuple[MemoryPort[Urg04Lx], Urg04LxDriver]:
    lidar = Urg04Lx(world=world, pose_at=pose_at, base_from_laser=Pose2(x_m=0.12), seed=seed, turn_s=turn_s)
    port = MemoryPort(lidar)
    return port, Urg04LxDriver(SerialPort(cast("serial.Serial", port)), options=options)


def scans_of(port: MemoryPort[Urg04Lx], driver: Urg04LxDriver, seconds: float) -> Iterator[Scan]:
    for _ in range(round(seconds / POLL_S)):
        port.pass_time(POLL_S)
        yield from driver.poll()


def expected_m(scan: Scan, pose_at: Callable[[FloatArray], FloatArray], world: World = ROOM) -> FloatArray:
    """Return the ranges of a perfect lidar at the scan's time stamps."""
    times_s = scan.time_s + np.arange(scan.ranges_m.size) * scan.time_increment_s
    poses = pose_at(times_s.astype(np.float64))
    x_m = poses[:, 0] + 0.12 * np.cos(poses[:, 2])
    y_m = poses[:, 1] + 0.12 * np.sin(poses[:, 2])
    return world.cast(x_m, y_m, poses[:, 2] + scan.angles_rad())


def median_error_m(scan: Scan, truth_m: FloatArray) -> float:
    return float(np.nanmedian(np.abs(scan.ranges_m - truth_m)))


def test_scan_matches_the_room() -> None:
    port, driver = connect()
    scans = list(scans_of(port, driver, 2.0))
    assert 19 <= len(scans) <= 21
    scan = scans[-1]
    assert scan.ranges_m.shape == (682,)
    assert scan.angle_min_rad == pytest.approx((44 - 384) * math.tau / 1024)
    assert (scan.range_min_m, scan.range_max_m) == pytest.approx((0.02, 5.6))
    assert 0.85 < np.isfinite(scan.ranges_m).mean() < 0.99
    truth_m = expected_m(scan, standing)
    assert median_error_m(scan, truth_m) < 0.05
    mirrored = World(segments_m=ROOM.segments_m * (1, -1, 1, -1), circles_m=ROOM.circles_m * (1, -1, 1))
    assert median_error_m(scan, expected_m(scan, standing, mirrored)) > 0.1


def test_each_beam_uses_the_pose_at_its_own_time() -> None:
    """At 3 rad/s the 67 ms between first and last beam distort the room by 11 degrees."""
    world = World(
        segments_m=np.array(
            [[-2.0, -1.5, 2.0, -1.5], [2, -1.5, 2, 1.5], [2, 1.5, -2, 1.5], [-2, 1.5, -2, -1.5]]
        ),
        circles_m=np.zeros((0, 3)),
    )
    pose_at = turning(3.0)
    port, driver = connect(pose_at, world=world)
    scan = list(scans_of(port, driver, 3.0))[-1]
    frozen = pose_at(np.full(682, scan.time_s))
    own_error_m = median_error_m(scan, expected_m(scan, pose_at, world))
    frozen_error_m = median_error_m(scan, expected_m(scan, lambda _: frozen, world))
    assert own_error_m < 0.04
    assert frozen_error_m > 3.0 * own_error_m


@pytest.mark.parametrize("turn_s", [0.1, 0.0982])
@pytest.mark.parametrize("seed", some_of([1, 2, 3]))
def test_time_stamps_are_the_times_of_beam_zero(turn_s: float, seed: int) -> None:
    """This holds if the lidar turns in step with the host's polling, and if it drifts."""
    port, driver = connect(turn_s=turn_s, seed=seed)
    for scan in scans_of(port, driver, 60.0):
        turn = round((scan.time_s - port.lidar._phase_s - 44 / 1024 * turn_s) / turn_s)
        true_s = port.lidar._phase_s + (turn + 44 / 1024) * turn_s
        assert scan.time_s == pytest.approx(true_s, abs=0.004)


def test_running_stream_is_taken_over() -> None:
    port, _ = connect()
    port.pass_time(0.35)
    driver = Urg04LxDriver(SerialPort(cast("serial.Serial", port)))
    assert len(list(scans_of(port, driver, 1.0))) >= 9
    assert driver.identity["PROT"] == "SCIP 2.0"


def test_lidar_in_clock_mode_is_recovered() -> None:
    port, driver = connect()
    driver.close()
    port.lidar.write(b"TM0\n", port.time_s)
    again = Urg04LxDriver(SerialPort(cast("serial.Serial", port)))
    assert len(list(scans_of(port, again, 1.0))) >= 9
    assert again.identity["PROT"] == "SCIP 2.0"


def test_damaged_bytes_lose_only_the_affected_scans() -> None:
    port, driver = connect()
    list(scans_of(port, driver, 0.5))
    good = driver.counters.samples
    port.spoil = lambda data: data[:700] + b"\x00" + data[701:] if data else data  # one byte wrong
    assert list(scans_of(port, driver, 0.5)) == []
    assert driver.counters.bad_replies == 5
    port.spoil = lambda data: data[:900] if data else data  # truncated
    port.pass_time(POLL_S)
    port.spoil = lambda data: data
    assert len(list(scans_of(port, driver, 0.5))) == 5, "the scan after the truncated one is complete"
    assert driver.counters.samples == good + 5


def test_silent_lidar_is_restarted() -> None:
    port, driver = connect()
    list(scans_of(port, driver, 0.5))
    port.lidar.write(b"QT\n", port.time_s)  # as after a brown-out
    scans = list(scans_of(port, driver, 3.0))
    assert driver.counters.restarts == 1
    assert len(scans) > 10


def test_unplugged_lidar_does_not_raise() -> None:
    port, driver = connect()
    port.unplugged = True
    assert list(scans_of(port, driver, 3.0)) == []
    assert driver.counters.port_errors > 10
    driver.close()
    assert port.closed


def test_zero_is_invalid_unless_configured_as_no_return() -> None:
    nothing = World(segments_m=np.array([[9.0, 9.0, 9.0, 9.5]]), circles_m=np.zeros((0, 3)))
    port, driver = connect(world=nothing)
    assert np.isnan(list(scans_of(port, driver, 0.5))[-1].ranges_m).all()
    port, driver = connect(world=nothing, options=Urg04LxOptions(zero_as_no_return=True))
    ranges_m = list(scans_of(port, driver, 0.5))[-1].ranges_m
    assert np.isposinf(ranges_m).mean() > 0.9, "code 0 means no return"
    assert np.isnan(ranges_m).any(), "the other codes stay invalid"


def test_close_stops_the_stream() -> None:
    port, driver = connect()
    driver.close()
    port.closed = False
    port.pass_time(0.2)
    port.read(1 << 16)
    port.pass_time(1.0)
    assert port.in_waiting == 0
