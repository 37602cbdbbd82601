"""On any input, the flashed firmware accepts valid frames, counts the rest, and keeps running."""

import pytest

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import frames, run_for, send
from thumper.board.framing import FrameDecoder, encode_frame
from thumper.board.messages import (
    Command,
    CommandRequest,
    Fault,
    GetParameter,
    Identify,
    Identity,
    ParameterValue,
    ResetCause,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ, Chip
from thumper_hil.chip.link_noise import send_damaged_requests
from thumper_hil.chip.robot_params import RobotParams

OCR2A, OCR2B = 0xB3, 0xB4
TRUNCATED = encode_frame(GetParameter.ID, 1, GetParameter(index=0).pack())


def test_damaged_frames_are_counted_and_valid_ones_answered() -> None:
    """Flipped bits, lost and doubled bytes, truncation, garbage: 20 000 frames, three in four damaged."""
    chip = Chip(ELF)
    chip.run(CPU_HZ // 10)
    chip.receive(chip.available)
    result = send_damaged_requests(chip, frames=20_000, seed=1)
    assert result.answers == result.expected
    assert result.counted_errors == result.expected_errors % 2**16
    assert result.host_errors == 0
    assert result.valid > 4_000
    assert result.expected_errors > 10_000
    assert [chip.data(address) for address in (OCR2A, OCR2B)] == [0, 0]
    assert chip.overruns == 0


def test_a_host_that_never_pauses_keeps_neither_time_out_nor_watchdog_away() -> None:
    """More requests than the line can answer, and no motion command."""
    chip = Chip(ELF, params=RobotParams.load())
    run_for(chip, 0.5)
    send(chip, CommandRequest(command=Command.ARM))
    flood = encode_frame(Identify.ID, 1, Identify().pack()) * 8
    for _ in range(800):
        chip.send(flood)
        run_for(chip, 0.001)
    received = frames(chip)
    states = [Telemetry.unpack(frame.payload) for frame in received if frame.message_id == Telemetry.ID]
    assert states[-1].fault is Fault.LINK_LOST
    assert len(states) >= 11  # ten per second, without a gap
    who = next(frame for frame in reversed(received) if frame.message_id == Identity.ID)
    assert Identity.unpack(who.payload).reset_cause is ResetCause.POWER_ON


@pytest.mark.parametrize("kept", range(len(TRUNCATED)))
def test_a_truncated_frame_costs_at_most_the_next_one(kept: int) -> None:
    """A frame truncated at any byte can destroy only the next one, because its delimiter is missing."""
    chip = Chip(ELF)
    chip.run(CPU_HZ // 10)
    chip.receive(chip.available)
    clean = [encode_frame(GetParameter.ID, sequence, GetParameter(index=0).pack()) for sequence in (2, 3)]
    chip.send(TRUNCATED[:kept] + b"".join(clean))
    chip.run(chip.cycle + CPU_HZ // 50)
    frames = FrameDecoder().feed(chip.receive(chip.available))
    answered = [frame.sequence for frame in frames if frame.message_id == ParameterValue.ID]
    assert answered == ([2, 3] if kept == 0 else [3])
