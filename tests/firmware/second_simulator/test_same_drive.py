"""The robot in the browser drives as the simulated robot: same firmware, same commands, same faults.

One runs on avr8js with motors in JavaScript, the other on simavr with motors in C++. Both robots are average:
no noise, no spread between parts.
"""

import json
from dataclasses import replace

import pytest
from scripts.browser_data import tables

from tests.firmware.board.boot import ELF, HEX
from tests.firmware.second_simulator.node import run_script
from tests.firmware.second_simulator.test_same_frames import frame
from thumper.board.framing import FrameDecoder
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    Fault,
    SetParameter,
    SetWheelSpeeds,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip, SideFaults, WireFault
from thumper_hil.chip.robot_params import RobotParams

CYCLES_PER_MS = CPU_HZ // 1000
UNTIL_MS = 9000
# The cut and its end are not on a control tick: which of both is first depends on a few cycles.
CUT_MS, AGAIN_MS, BLOCKED_MS = 5420, 6720, 7500
KP, DECELERATION = (
    next(setting for setting in PARAMETERS if setting.name == name) for name in ("kp", "deceleration")
)
SPEEDS = {300: (5.0, 5.0), 1500: (-3.0, 3.0), 2800: (8.0, 6.0), 3800: (4.0, 4.0)}
"""Set-points [rad/s] from these milliseconds on: ahead, turn on the spot, fast curve, ahead."""

# No stop from speed: a bridge opens at PWM 0 and brakes at PWM 1, so that one count changes it.
BOUNDS = {
    "left_setpoint": 0,
    "right_setpoint": 0,
    "left_count": 20,  # a duty of 255 ends up to 1 ms apart
    "right_count": 20,
    "left_speed": 210,  # four counts in a control tick; the edges move by less than one
    "right_speed": 210,
    "left_pwm": 4,
    "right_pwm": 4,
    "battery_mV": 2,
    "rx_frames": 1,  # one may end as a tick begins
    "rx_errors": 0,
}
"""Largest difference of each field, in its unit."""


def average_robot() -> RobotParams:
    """Return the simulated robot without noise and without spread between its parts."""
    robot = RobotParams.load()
    motor = replace(robot.motor, noise_Nm=0.0, spread_ratio=0.0, unit_spread_ratio=0.0)
    body = replace(robot.body, radius_spread_ratio=0.0, track_spread_ratio=0.0, track_noise_ratio=0.0)
    return replace(robot, motor=motor, body=body, encoder=replace(robot.encoder, edge_error_counts=0.0))


def commands() -> dict[int, bytes]:
    """Return what the host sends, by the millisecond in which it begins."""
    sent = {}
    speeds = (0.0, 0.0)
    for ms in range(250, UNTIL_MS, 50):
        speeds = SPEEDS.get(ms, speeds)
        left, right = (round(1000.0 * speed) for speed in speeds)
        sent[ms] = frame(SetWheelSpeeds(left=left, right=right))
    sent[250] += frame(SetParameter(index=DECELERATION.index, value=0))  # harder, it brakes at about PWM 0
    sent[250] += frame(CommandRequest(command=Command.ARM))
    # With 20 a count more or less swings on: the tick before the fault then differs by five counts.
    sent[4500] += frame(SetParameter(index=KP.index, value=round(12.0 * KP.scale)))
    sent[AGAIN_MS] = frame(CommandRequest(command=Command.CLEAR_FAULT))
    sent[AGAIN_MS + 100] = frame(CommandRequest(command=Command.ARM))
    return sent


def telemetry_of(data: bytes) -> list[Telemetry]:
    """Return the telemetry in a stream of bytes."""
    frames = FrameDecoder().feed(data)
    return [Telemetry.unpack(each.payload) for each in frames if each.message_id == Telemetry.ID]


def test_drive_gains_and_faults_agree() -> None:
    robot = average_robot()
    job = {
        "hex": HEX.read_text("ascii"),
        "params": tables(robot),
        "until_ms": UNTIL_MS,
        "sent": {ms: list(data) for ms, data in commands().items()},
        "cut": {CUT_MS: 0},
        "restored": {AGAIN_MS: 0},
        "blocked": {BLOCKED_MS: 1},
    }
    answer = json.loads(run_script("same_drive.mjs", job))
    theirs, there = telemetry_of(bytes(answer["bytes"])), answer["truth"]

    chip = FaultyChip(ELF, params=robot)
    for ms in range(UNTIL_MS):
        if ms in commands():
            chip.send(commands()[ms])
        if ms == CUT_MS:
            chip.set_wire_fault(0, 0, WireFault.CUT)
        if ms == AGAIN_MS:
            chip.set_wire_fault(0, 0, WireFault.OK)
        if ms == BLOCKED_MS:
            chip.set_side_faults(1, SideFaults(blocked=True))
        chip.run((ms + 1) * CYCLES_PER_MS)
    ours, here = telemetry_of(chip.receive(chip.available)), chip.truth()

    assert [(each.state, each.fault) for each in theirs] == [(each.state, each.fault) for each in ours]
    assert {each.fault for each in ours} == {Fault.NONE, Fault.STALL_LEFT, Fault.STALL_RIGHT}
    for field, most in BOUNDS.items():
        for one, other in zip(ours, theirs, strict=True):
            assert getattr(other, field) == pytest.approx(getattr(one, field), abs=most), (one, field)
    assert there["x_m"] == pytest.approx(here.map_from_base.x_m, abs=0.005)
    assert there["y_m"] == pytest.approx(here.map_from_base.y_m, abs=0.005)
    assert there["yaw_rad"] == pytest.approx(here.map_from_base.theta_rad, abs=0.02)
    assert there["battery_V"] == pytest.approx(here.battery_V, abs=0.001)
