"""`sim://` ports: pyserial's behaviour, one world on one clock, determinism, contacts, errors."""

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import serial

from thumper.board.framing import encode_frame
from thumper.board.messages import Command, CommandRequest, Identify, SetMotorPwm
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.serial_port import open_port
from thumper_hil.bench import Bench, simulation
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.options import BenchOptions
from thumper_hil.bench.protocol_sim import Serial

OpenPort = Callable[[str], Serial]


@pytest.fixture
def open_sim() -> Iterator[OpenPort]:
    """Return a function that opens `sim://port-test/...`; all are closed afterwards."""
    ports = []

    def open_(rest: str) -> Serial:
        port = open_port(f"sim://port-test/{rest}", baud=500_000, name="test").raw
        assert isinstance(port, Serial)
        ports.append(port)
        return port

    yield open_
    for port in ports:
        port.close()


def push(bench: Bench, left: int, right: int, seconds: float) -> None:
    """Drive with open-loop PWM."""
    for _ in range(round(seconds / 0.1)):
        bench.chip.send(encode_frame(SetMotorPwm.ID, 1, SetMotorPwm(left=left, right=right).pack()))
        bench.advance(bench.time_s + 0.1)


def armed(options: BenchOptions) -> Bench:
    bench = Bench(options)
    bench.advance(0.1)
    arm = CommandRequest(command=Command.ARM)
    bench.chip.send(encode_frame(arm.ID, 1, arm.pack()))
    return bench


def test_read_takes_simulated_time_and_write_none(open_sim: OpenPort) -> None:
    port = open_sim("board")
    port.timeout = 0.25
    bench = simulation("port-test")
    assert port.read(10_000) != b""  # some telemetry, but not 10 000 bytes
    assert bench.time_s == pytest.approx(0.25, abs=1e-5)
    before_s = bench.time_s
    assert port.write(encode_frame(Identify.ID, 1, b"")) == 6
    assert port.in_waiting == 0
    assert bench.time_s == before_s
    port.timeout = 0.0
    assert port.read(1) == b""
    assert bench.time_s == before_s
    port.timeout = None
    assert len(port.read(3)) == 3
    assert bench.time_s < before_s + 0.01
    assert port.clock_s() == bench.time_s


def test_reset_input_buffer_discards_bytes(open_sim: OpenPort) -> None:
    port = open_sim("board")
    simulation("port-test").advance(0.5)
    assert port.in_waiting > 100
    port.reset_input_buffer()
    assert port.in_waiting == 0


def test_both_ports_share_one_clock(open_sim: OpenPort) -> None:
    board, lidar = open_sim("board?seed=3"), open_sim("lidar")
    lidar.timeout = 0.5
    lidar.write(b"VV\n")
    reply = lidar.read(20)
    assert reply.startswith(b"VV\n00P\nVEND:Hokuyo")
    assert board.clock_s() == lidar.clock_s() > 0.0
    assert board.clock_s() < 0.1  # the read did not wait longer than necessary


def test_closed_port_raises(open_sim: OpenPort) -> None:
    port = open_sim("board")
    port.close()
    for use in (lambda: port.read(1), lambda: port.write(b"x"), lambda: port.in_waiting):
        with pytest.raises(serial.SerialException, match="not open"):
            use()
    assert simulation("port-test").truth().shape == (0, 6)


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        ("engine", "not a simulated device"),
        ("board?world=atlantis", "atlantis"),
        ("board?colour=red", "unknown simulator option 'colour'"),
        ("board?seed=one", "whole number"),
        ("board?x_m=nan", "number"),
        ("board?charge=2", "0...1"),
        ("board?seed=1&seed=2", "twice"),
        ("board?x_m=2.96", "obstacle"),  # the footprint would reach through the wall
    ],
)
def test_invalid_url_is_reported_in_one_line(open_sim: OpenPort, rest: str, words: str) -> None:
    with pytest.raises(ThumperError, match=words) as caught:
        open_sim(rest)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_device_opens_once_and_options_cannot_change(open_sim: OpenPort) -> None:
    open_sim("board?seed=5")
    with pytest.raises(ThumperError, match="already open") as caught:
        open_sim("board?seed=5")
    assert caught.value.exit_code == 3
    with pytest.raises(ThumperError, match="other options"):
        open_sim("lidar?seed=6")
    open_sim("lidar?seed=5")


def test_closing_all_ports_ends_the_simulation(open_sim: OpenPort) -> None:
    open_sim("board").close()
    old = simulation("port-test")
    open_sim("board?seed=9")
    assert simulation("port-test") is not old


def run_bytes(seed: int) -> tuple[bytes, bytes, bytes]:
    """Return the output of a short drive: the bytes of both ports and the ground truth."""
    bench = armed(BenchOptions(seed=seed))
    bench.sensor_write("lidar", b"BM\nMD0044072501000\n")
    board, lidar = bytearray(), bytearray()
    for left, right in ((120, 120), (90, -90), (200, 150)):
        push(bench, left, right, 0.4)
        board += bench.chip.receive(10_000)
        lidar += bench.sensor_read("lidar", 100_000)
    return bytes(board), bytes(lidar), bench.truth().tobytes()


def test_same_seed_same_bytes() -> None:
    first, again, other = run_bytes(1), run_bytes(1), run_bytes(2)
    assert first == again
    assert len(first[0]) > 500
    assert len(first[1]) > 10_000
    assert all(a != b for a, b in zip(first, other, strict=True))


def test_ground_truth_is_consistent_at_100_Hz() -> None:
    bench = armed(BenchOptions(x_m=-1.0))
    push(bench, 120, 120, 1.0)
    truth = bench.truth()
    assert np.diff(truth[:, 0]) == pytest.approx(np.full(len(truth) - 1, 0.01), abs=1e-6)
    driven_m = np.hypot(np.diff(truth[:, 1]), np.diff(truth[:, 2])).sum()
    rolled_m = 0.062 * truth[:, 4:6].mean(axis=1).sum() * 0.01
    assert driven_m == pytest.approx(rolled_m, rel=0.02)
    assert truth[-1, 1] > -1.0 + 0.2  # along x


def test_wall_blocks_the_robot_and_counts_one_contact() -> None:
    """A long push is one contact, the footprint stays out of the wall, and backing off allows another."""
    bench = armed(BenchOptions(x_m=2.0, y_m=0.0))
    push(bench, 150, 150, 3.0)
    assert bench.contacts == 1
    held = bench.truth()[-1]
    push(bench, 150, 150, 1.0)
    assert np.hypot(*(bench.truth()[-1, 1:3] - held[1:3])) < 0.01
    for _, x_m, y_m, theta_rad, _, _ in bench.truth()[::10]:
        assert not bench.world.touches(Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad), FOOTPRINT_M)
    push(bench, -120, -120, 1.0)
    assert bench.truth()[-1, 1] < held[1] - 0.1
    assert bench.contacts == 1
    push(bench, 150, 150, 2.0)
    assert bench.contacts == 2


def test_yaw_follows_the_effective_track() -> None:
    """Rotation equals the wheel travel over 0.3675 m, growing by 4 % per rad/s, with an error of 3 %."""
    bench = armed(BenchOptions())
    push(bench, -140, 140, 1.5)
    truth = bench.chip.truth()
    turned_rad = float(np.unwrap(bench.truth()[:, 3])[-1])
    wheels_rad = 0.062 * (truth.wheel_rad[1] - truth.wheel_rad[0]) / 0.3675
    assert turned_rad > math.pi / 2
    grown = 1.0 + 0.04 * wheels_rad / 1.5
    assert turned_rad == pytest.approx(wheels_rad / grown, rel=0.06)
