"""Heading increments from telemetry: across a wrap, a lost message and a gap of the device."""

import math

import pytest
from benchmarks.shared.telemetry import telemetry_sample

from thumper.board.gyroscope import GyroIncrements
from thumper.board.messages import GyroscopeState


def increments(*messages: tuple[int, GyroscopeState]) -> list[float | None]:
    """Return the increment of each message, given its heading [rev/65536] and state."""
    gyro = GyroIncrements()
    return [
        gyro.add(telemetry_sample(0.1 * number, heading=heading, gyroscope=state).telemetry)
        for number, (heading, state) in enumerate(messages)
    ]


def test_increments_have_the_sign_of_the_turn_also_across_the_wrap() -> None:
    ready = GyroscopeState.READY
    found = increments((65000, ready), (464, ready), (65000, ready), (65000, ready))
    assert found[0] is None
    assert found[1:] == pytest.approx([1000 * math.tau / 65536, -1000 * math.tau / 65536, 0.0])


def test_a_lost_message_loses_no_rotation() -> None:
    ready = GyroscopeState.READY
    assert increments((0, ready), (900, ready))[1] == pytest.approx(900 * math.tau / 65536)


@pytest.mark.parametrize("state", [GyroscopeState.OFF, GyroscopeState.MISSING, GyroscopeState.CALIBRATING])
def test_no_increment_spans_a_gap_of_the_device(state: GyroscopeState) -> None:
    ready = GyroscopeState.READY
    found = increments((0, ready), (10, ready), (10, state), (500, ready), (510, ready))
    assert found[1] is not None
    assert found[2:4] == [None, None]
    assert found[4] == pytest.approx(10 * math.tau / 65536)
