"""Test the driver of RPLIDAR and YDLIDAR against the simulated ones, byte for byte, on simulated time."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
import serial

from tests.hil.lidars.memory_port import MemoryPort, standing
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.serial_port import SerialPort
from thumper.lidar.a5_lidar import A5Lidar, RplidarOptions
from thumper.lidar.a5_models import A5_MODELS
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarModel, LidarOptions
from thumper.lidar.scan import Scan
from thumper_hil.bench.hardware import LIDAR_MODELS
from thumper_hil.lidars.a5_device import A5Device
from thumper_hil.lidars.beams import UNDISTURBED
from thumper_hil.world.world import World

ROOM = World.load("lab")
MOUNT = Pose2(x_m=0.12)
POLL_S = 0.1  # as the robot's control cycle
MODES = [(name, True) for name in A5_MODELS] + [("rplidar_a1", False), ("rplidar_a2", False)]
BEAMS = {"rplidar_a1": 727, "rplidar_a2": 400, "rplidar_c1": 500, "ydlidar_x4": 714}
TURNS_PER_S = {"rplidar_a1": 5.5, "rplidar_a2": 10.0, "rplidar_c1": 10.0, "ydlidar_x4": 7.0}
BIAS_MAX_M = {"rplidar_a1": 0.02, "rplidar_a2": 0.02, "rplidar_c1": 0.03, "ydlidar_x4": 0.06}


def turning(times_s: FloatArray) -> FloatArray:
    still = np.zeros_like(times_s)
    return np.column_stack([still, still, 2.0 * times_s])


def device(
    name: str, pose_at: Callable[[FloatArray], FloatArray] = standing, *, seed: int = 1, drift: float = 0.0
) -> A5Device:
    lidar = LIDAR_MODELS[name](
        world=ROOM,
        pose_at=pose_at,
        base_from_laser=MOUNT,
        seed=seed,
        conditions=replace(UNDISTURBED, clock_drift=drift),
    )
    assert isinstance(lidar, A5Device)
    return lidar


def connect(lidar: A5Device, name: str, *, express: bool = True) -> tuple[MemoryPort[A5Device], A5Lidar]:
    return (port := MemoryPort(lidar)), start(port, name, express=express)


def start(port: MemoryPort[A5Device], name: str, *, express: bool = True) -> A5Lidar:
    options = RplidarOptions(express=express)
    return A5Lidar(SerialPort(cast("serial.Serial", port)), model=A5_MODELS[name], options=options)


def scans_of(port: MemoryPort[A5Device], driver: A5Lidar, seconds: float) -> list[Scan]:
    scans = []
    for _ in range(round(seconds / POLL_S)):
        port.pass_time(POLL_S)
        scans += driver.poll()
    return scans


def truth_m(scan: Scan, pose_at: Callable[[FloatArray], FloatArray], late_s: float = 0.0) -> FloatArray:
    """Return the ranges of a perfect lidar at the scan's time stamps and angles."""
    times_s = scan.time_s + np.arange(scan.ranges_m.size) * scan.time_increment_s + late_s
    poses = pose_at(times_s.astype(np.float64))
    x_m = poses[:, 0] + MOUNT.x_m * np.cos(poses[:, 2])
    y_m = poses[:, 1] + MOUNT.x_m * np.sin(poses[:, 2])
    return ROOM.cast(x_m, y_m, poses[:, 2] + scan.angles_rad())


@pytest.mark.parametrize(("name", "express"), MODES)
def test_scan_is_clockwise_complete_and_correct(name: str, express: bool) -> None:
    port, driver = connect(device(name), name, express=express)
    scans = scans_of(port, driver, 3.0)
    assert len(scans) == pytest.approx(3.0 * TURNS_PER_S[name], rel=0.1)
    scan = scans[-1]
    assert scan.ranges_m.size == pytest.approx(BEAMS[name] / (1 if express else 2), rel=0.1)
    assert scan.angle_min_rad == pytest.approx(math.pi), "a scan starts at the rear"
    assert scan.angle_increment_rad * scan.ranges_m.size == pytest.approx(-math.tau)
    assert scan.time_increment_s * scan.ranges_m.size == pytest.approx(1 / TURNS_PER_S[name], rel=0.1)
    error_m = scan.ranges_m - truth_m(scan, standing)
    assert np.isfinite(error_m).mean() > 0.99
    assert abs(np.median(error_m)) < BIAS_MAX_M[name]
    assert np.median(np.abs(error_m - np.median(error_m))) < 0.006


@pytest.mark.parametrize(("name", "express"), MODES)
@pytest.mark.parametrize(
    "drift", [0.005, *(pytest.param(drift, marks=pytest.mark.slow) for drift in (0.0, -0.005))]
)
def test_time_stamps_are_right_while_turning(name: str, express: bool, drift: float) -> None:
    """At 2 rad/s a time stamp error of 20 ms would shift the room by 2.3 degrees."""
    port, driver = connect(device(name, turning, drift=drift), name, express=express)
    for scan in scans_of(port, driver, 12.0)[10:]:
        early_m, right_m, late_m = (
            np.nanmedian(np.abs(scan.ranges_m - truth_m(scan, turning, late_s)))
            for late_s in (-0.03, 0, 0.03)
        )
        assert right_m < 0.02
        assert right_m < early_m
        assert right_m < late_m


@pytest.mark.parametrize(("name", "express"), MODES)
def test_lost_bytes_are_counted_and_distort_nothing(name: str, express: bool) -> None:
    port, driver = connect(device(name, turning), name, express=express)
    scans_of(port, driver, 0.5)
    rng = np.random.default_rng(3)

    def lose(data: bytes) -> bytes:
        at = int(rng.integers(0, max(len(data) - 61, 1)))
        return data[:at] + data[at + 61 :] if rng.random() < 0.3 else data

    port.spoil = lose
    scans = scans_of(port, driver, 5.0)
    assert len(scans) > 4.0 * TURNS_PER_S[name]
    assert driver.counters.bad_replies > 5
    assert driver.counters.lost_points > 50
    assert any(np.isnan(scan.ranges_m).any() for scan in scans)
    for scan in scans:
        assert np.nanmedian(np.abs(scan.ranges_m - truth_m(scan, turning))) < 0.03
        assert scan.ranges_m.size == pytest.approx(BEAMS[name] / (1 if express else 2), rel=0.1)


@pytest.mark.parametrize(("name", "express"), MODES)
def test_a_host_that_reads_late_shifts_no_stamp(name: str, express: bool) -> None:
    """The bytes wait in the port. They are old then, but none is lost."""
    port, driver = connect(device(name, turning), name, express=express)
    port.pass_time(1.0)  # before its first poll a robot opens the board
    stamps_s = []
    for pause_s in (0.1, 0.1, 0.9, 0.1, 0.1, 0.4, 0.1, 0.1, 0.1):
        port.pass_time(pause_s)
        for scan in driver.poll():
            stamps_s.append(scan.time_s)
            assert np.nanmedian(np.abs(scan.ranges_m - truth_m(scan, turning))) < 0.03
    assert np.diff(stamps_s) == pytest.approx(1 / TURNS_PER_S[name], rel=0.2)
    assert driver.counters.lost_points == 0


@pytest.mark.parametrize(("name", "express"), MODES)
def test_a_scan_that_is_under_way_is_stopped_first(name: str, express: bool) -> None:
    """The program before crashed: the lidar sends, and the first bytes are from the middle of a packet."""
    port, _ = connect(device(name), name, express=express)
    port.pass_time(1.013)
    port.read(37)
    driver = start(port, name, express=express)
    assert len(scans_of(port, driver, 1.0)) >= 4
    assert driver.counters.bad_replies == 0


@pytest.mark.parametrize("name", A5_MODELS)
def test_a_lidar_that_lost_its_supply_is_started_again(name: str) -> None:
    port, driver = connect(device(name), name)
    port.lidar.power_off()
    port.unplugged = True
    assert scans_of(port, driver, 1.0) == []
    assert driver.counters.port_errors == 10
    port.unplugged = False
    assert scans_of(port, driver, 8.0)
    assert driver.counters.restarts == 1


@pytest.mark.parametrize("name", ["rplidar_a1", "rplidar_a2", "ydlidar_x4"])
def test_motor_runs_only_while_the_lidar_is_open(name: str) -> None:
    port, driver = connect(device(name), name)
    assert port.lidar.is_turning
    driver.close()
    port.pass_time(0.1)
    assert not port.lidar.is_turning


@pytest.mark.parametrize("name", A5_MODELS)
def test_a_blocked_head_and_an_error_are_told_in_one_line(name: str) -> None:
    lidar = device(name)
    lidar.is_blocked = True
    with pytest.raises(ThumperError, match="answers but sends no points; is its head free") as caught:
        connect(lidar, name)
    assert "\n" not in str(caught.value)
    lidar = device(name)
    lidar.health = 2
    with pytest.raises(ThumperError, match="reports error 0x8001 and has stopped; free its head"):
        connect(lidar, name)
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("connected", A5_MODELS)
@pytest.mark.parametrize("asked", A5_MODELS)
def test_another_lidar_or_a_wrong_baud_rate_is_told_in_one_line(connected: str, asked: LidarModel) -> None:
    port = f"sim://{connected}-{asked}/lidar?lidar={connected}"
    if connected == asked:
        with pytest.raises(ThumperError, match=f"answers on {port} at 9600 baud .it needs".replace("?", ".")):
            open_lidar(LidarOptions(port=port, model=asked, baud=9600))
        return
    with pytest.raises(ThumperError) as caught:
        open_lidar(LidarOptions(port=port, model=asked))
    assert "\n" not in str(caught.value)
    if {connected, asked} == {"rplidar_a1", "rplidar_a2"}:  # of the same speed
        assert f'set [lidar] model = "{connected}"' in str(caught.value)
    else:
        assert "check its cable and supply, and [lidar] port, model and baud" in str(caught.value)


@pytest.mark.parametrize(("name", "express"), MODES)
def test_bytes_do_not_depend_on_the_step_size(name: str, express: bool) -> None:
    def run(step_s: float, seed: int) -> bytes:
        lidar = device(name, seed=seed)
        model = A5_MODELS[name]
        lidar.set_dtr(bool(model.dtr(run=True)), 0.0)
        request = model.express if model.express and express else model.scan
        lidar.write(model.motor_request(run=True) + request, 0.0)
        data = b""
        for step in range(round(2.4 / step_s)):
            lidar.advance((step + 1) * step_s)
            data += lidar.read()
        return data

    assert len(run(0.05, 3)) > 3000
    assert run(0.001, 3) == run(0.05, 3)
    assert run(0.05, 3) != run(0.05, 4)
