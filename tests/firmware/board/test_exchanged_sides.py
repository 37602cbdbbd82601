"""Left and right exchanged: which commands show it. The image's pins are exchanged instead of the wires."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.firmware.board.boot import ROOT
from tests.firmware.board.wire import first_fault, frames, run_for, send
from thumper.board.messages import (
    Command,
    CommandRequest,
    Fault,
    Message,
    SetMotorPwm,
    SetWheelSpeeds,
    Telemetry,
)
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

LEFT, RIGHT = "left_encoder.count()", "right_encoder.count()"
EXCHANGED: dict[str, tuple[tuple[str, str], ...]] = {
    "motors": (
        (
            "drive.Set(samples.left.wheel.pwm, samples.right.wheel.pwm)",
            "drive.Set(samples.right.wheel.pwm, samples.left.wheel.pwm)",
        ),
    ),
    "encoders": ((LEFT, "OTHER"), (RIGHT, LEFT), ("OTHER", RIGHT)),
}
TURN_US, SHALLOW_US = (
    1_300_000,
    2_200_000,
)  # measured: up to 1.2 and 2.1 s (docs/howto/porting.md); a tick of margin


@pytest.fixture(scope="module", params=EXCHANGED)
def elf(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the image of a robot whose motors or encoders are exchanged."""
    firmware = tmp_path_factory.mktemp(request.param) / "firmware"
    shutil.copytree(ROOT / "firmware", firmware, ignore=shutil.ignore_patterns("build"))
    source = firmware / "app" / "main.cpp"
    text = source.read_text(encoding="utf-8")
    for old, new in EXCHANGED[request.param]:
        assert text.count(old) == 1
        text = text.replace(old, new)
    source.write_text(text, encoding="utf-8")
    subprocess.run(["make", "-s", "-C", str(firmware)], check=True, capture_output=True)
    return firmware / "build" / "thumper.elf"


def fault_of(elf: Path, command: Message, seconds: float) -> tuple[Fault, int]:
    """Return the first fault while this command is repeated, and its time [us] after the first PWM."""
    chip = InstrumentedChip(elf, params=RobotParams.load(), seed=1)
    run_for(chip, 0.3)
    send(chip, CommandRequest(command=Command.ARM))
    run_for(chip, 0.05)
    end_s = chip.time_s + seconds
    while chip.time_s < end_s:
        send(chip, command)
        run_for(chip, 0.02)
    return first_fault(
        [Telemetry.unpack(frame.payload) for frame in frames(chip) if frame.message_id == Telemetry.ID]
    )


@pytest.mark.parametrize("pwm", [(130, -130), (-200, 200)])
def test_a_turn_in_place_ends_in_a_named_fault_within_300_ms_of_pwm(elf: Path, pwm: tuple[int, int]) -> None:
    fault, after_us = fault_of(elf, SetMotorPwm(left=pwm[0], right=pwm[1]), 1.0)
    assert fault in {Fault.REVERSED_LEFT, Fault.REVERSED_RIGHT}
    assert after_us <= 300_000


@pytest.mark.parametrize(
    ("left", "right", "limit_us"),
    [
        (2000, -2000, TURN_US),
        (4000, 0, TURN_US),
        (6000, 3000, TURN_US),
        (3000, 2000, SHALLOW_US),
        (6000, 5000, SHALLOW_US),
    ],
)
def test_turns_and_arcs_in_closed_loop_end_in_a_named_fault(
    elf: Path, left: int, right: int, limit_us: int
) -> None:
    fault, after_us = fault_of(elf, SetWheelSpeeds(left=left, right=right), 3.0)
    assert fault in {Fault.REVERSED_LEFT, Fault.REVERSED_RIGHT}
    assert after_us <= limit_us


@pytest.mark.parametrize(
    "command",
    [
        SetWheelSpeeds(left=4000, right=4000),
        SetMotorPwm(left=130, right=130),
        SetMotorPwm(left=130, right=0),
        SetMotorPwm(left=130, right=100),
    ],
)
def test_nothing_shows_it_straight_ahead_or_in_arcs_by_pwm(elf: Path, command: Message) -> None:
    """A known limit. Straight ahead both sides get the same; one motor drags the other wheel along, which
    then counts as commanded. `thumper doctor --spin`, with the wheels in the air, names it."""
    assert fault_of(elf, command, 2.0)[0] is Fault.NONE
