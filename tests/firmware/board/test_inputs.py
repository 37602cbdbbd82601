"""The protecting inputs on the emulated chip: a closed switch stops the driving motors of every board."""

import pytest

from tests.firmware.board.boot import BUILD
from tests.firmware.board.wire import frames, run_for, send
from thumper.board.messages import (
    PARAMETERS,
    BoardModel,
    Command,
    CommandRequest,
    Fault,
    GetParameter,
    SetMotorPwm,
    SetParameter,
    State,
    Telemetry,
)
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.robot_params import RobotParams

OCR2A, OCR2B = 0xB3, 0xB4
PORTB, PORTC, PORTD = 0x25, 0x28, 0x2B
PULL_UPS = {BoardModel.TREX: [(PORTD, 7), (PORTB, 0)], BoardModel.NANO: [(PORTC, 0), (PORTC, 1)]}
INDEX = {spec.name: spec.index for spec in PARAMETERS}
OFF, WHILE_LOW, WHILE_HIGH = range(3)
SHORTEST_TICK_S = 0.01
"""The control tick at 100 Hz; the inputs do not depend on the rate."""


def driving(board: BoardModel = BoardModel.TREX, **modes: int) -> FaultyChip:
    """Return a robot that drives by PWM, both switches as their modes want them while driving."""
    folder = BUILD if board is BoardModel.TREX else BUILD / board.name.lower()
    chip = FaultyChip(folder / "thumper.elf", params=RobotParams.load(), board=board)
    for name, mode in modes.items():
        chip.set_switch(int(name[-1]), closed=mode == WHILE_HIGH)
    run_for(chip, 0.2)
    for name, mode in modes.items():
        send(chip, SetParameter(index=INDEX[name], value=mode))
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(2):
        send(chip, SetMotorPwm(left=100, right=100))
        run_for(chip, 0.1)
    assert duties(chip) == [100, 100]
    return chip


def duties(chip: FaultyChip) -> list[int]:
    return [chip.data(address) for address in (OCR2A, OCR2B)]


def fault(chip: FaultyChip) -> tuple[State, Fault]:
    """Return state and fault of the next telemetry."""
    chip.receive(chip.available)
    run_for(chip, 0.12)
    last = Telemetry.unpack([f for f in frames(chip) if f.message_id == Telemetry.ID][-1].payload)
    return last.state, last.fault


@pytest.mark.parametrize("mode", [WHILE_LOW, WHILE_HIGH])
@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("board", list(BoardModel), ids=lambda board: board.name.lower())
def test_a_switch_stops_the_motors_within_a_tick(board: BoardModel, number: int, mode: int) -> None:
    """A switch that opens may also be a cut wire."""
    chip = driving(board, **{f"input_{number}": mode})
    for pin in PULL_UPS[board]:
        assert chip.data(pin[0]) & 1 << pin[1]
    chip.set_switch(number, closed=mode == WHILE_LOW)
    run_for(chip, SHORTEST_TICK_S)
    assert duties(chip) == [0, 0]
    assert fault(chip) == (State.FAULT, Fault[f"INPUT_{number}"])


def test_a_flood_of_requests_does_not_delay_the_stop() -> None:
    chip = driving(input_2=WHILE_LOW)
    for _ in range(200):
        send(chip, GetParameter(index=0))
    run_for(chip, 0.01)
    assert duties(chip) == [100, 100]
    chip.set_switch(2, closed=True)
    run_for(chip, 2 * SHORTEST_TICK_S)
    assert duties(chip) == [0, 0]


def test_a_pulse_of_two_milliseconds_is_no_contact() -> None:
    chip = driving(input_1=WHILE_LOW)
    for _ in range(10):
        chip.set_switch(1, closed=True)
        run_for(chip, 0.002)
        chip.set_switch(1, closed=False)
        run_for(chip, 0.003)
        send(chip, SetMotorPwm(left=100, right=100))
    assert duties(chip) == [100, 100]
    assert fault(chip)[1] is Fault.NONE


def test_an_unused_input_does_nothing() -> None:
    """Existing robots may have anything at these pins."""
    chip = driving()
    for number in (1, 2):
        chip.set_switch(number, closed=True)
    run_for(chip, 0.05)
    assert duties(chip) == [100, 100]
    assert fault(chip)[1] is Fault.NONE
