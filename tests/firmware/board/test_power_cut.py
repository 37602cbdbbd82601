"""Power may fail at or between any bytes of a save: a complete parameter set survives."""

from itertools import pairwise

import pytest

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import ask, identity, run_for, send
from tests.variants import some_of
from thumper.board.messages import (
    PARAMETERS,
    Ack,
    AckStatus,
    Command,
    CommandRequest,
    GetParameter,
    ParameterSource,
    ParameterValue,
    SetParameter,
)
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

STEP_S = 1e-3
"""Shorter than the writing of one byte."""

SAVE_S = 0.3
TORN = (0x00, 0x55, 0xFF)
"""Possible values of the interrupted byte, besides its old and its new value."""


def board() -> InstrumentedChip:
    """Return a board with a charged battery, because saving is refused on a low one."""
    return InstrumentedChip(ELF, params=RobotParams.load())


def values(part: float) -> list[int]:
    """Return a parameter set at this fraction of each range."""
    return [
        round(spec.scale * spec.default)
        # A save needs a charged battery; the gyroscope and currents at A4 exclude each other.
        if spec.name.startswith(("battery", "currents_at_a4"))
        else round(spec.scale * (spec.minimum + part * (spec.maximum - spec.minimum)))
        for spec in PARAMETERS
    ]


def choose(chip: InstrumentedChip, wanted: list[int]) -> None:
    """Make these the live parameters."""
    for index, value in enumerate(wanted):
        frame = ask(chip, SetParameter(index=index, value=value), Ack)
        assert frame is not None
        assert Ack.unpack(frame.payload).status is AckStatus.OK


def save(chip: InstrumentedChip) -> list[bytes]:
    """Save the parameters; return the EEPROM before and after each written byte."""
    snapshots = [chip.eeprom()]
    send(chip, CommandRequest(command=Command.SAVE))
    for _ in range(round(SAVE_S / STEP_S)):
        run_for(chip, STEP_S)
        if (now := chip.eeprom()) != snapshots[-1]:
            snapshots.append(now)
    return snapshots


def after_power_on(eeprom: bytes) -> tuple[list[int], ParameterSource]:
    """Return the parameters and their source after a start with this EEPROM."""
    chip = board()
    chip.write_eeprom(eeprom)
    run_for(chip, 0.02)
    who = identity(chip)
    assert who is not None
    found = []
    for index in range(len(PARAMETERS)):
        frame = ask(chip, GetParameter(index=index), ParameterValue, wait_s=0.003)
        assert frame is not None
        found.append(ParameterValue.unpack(frame.payload).value)
    return found, who.parameters


@pytest.fixture(scope="module")
def saves() -> list[list[bytes]]:
    """The EEPROM's history over three saves: into an empty one, into the other slot, and over the oldest."""
    chip = board()
    run_for(chip, 0.02)
    history = []
    for part in (0.1, 0.52, 0.93):
        choose(chip, values(part))
        history.append(save(chip))
    return history


def test_a_save_is_kept(saves: list[list[bytes]]) -> None:
    for snapshots, part in zip(saves, (0.1, 0.52, 0.93), strict=True):
        assert after_power_on(snapshots[-1]) == (values(part), ParameterSource.SAVED)


def test_a_cut_in_the_first_save_leaves_the_defaults(saves: list[list[bytes]]) -> None:
    defaults = [round(spec.scale * spec.default) for spec in PARAMETERS]
    for eeprom in saves[0][:-1]:
        assert after_power_on(eeprom) == (defaults, ParameterSource.DEFAULTS)


@pytest.mark.parametrize(("number", "before", "after"), some_of([(1, 0.1, 0.52), (2, 0.52, 0.93)]))
def test_a_cut_in_a_later_save_leaves_the_old_set_or_the_new(
    saves: list[list[bytes]], number: int, before: float, after: float
) -> None:
    snapshots = saves[number]
    # A snapshot is a byte that changes. Between these sets most parameters change both bytes, the four
    # directions (0 or 1) one, and the three of the battery none: 30 of 40, beside sequence number and CRC.
    assert len(snapshots) > 1.5 * len(PARAMETERS)
    for eeprom in snapshots[:-1]:
        assert after_power_on(eeprom) == (values(before), ParameterSource.SAVED)
    whole = (values(before), values(after))
    for eeprom, following in pairwise(snapshots):
        places = [place for place in range(len(eeprom)) if eeprom[place] != following[place]]
        assert len(places) == 1  # one byte at a time
        for torn in TORN:
            damaged = bytearray(eeprom)
            damaged[places[0]] = torn
            found, source = after_power_on(bytes(damaged))
            assert found in whole
            assert source is ParameterSource.SAVED


def test_edges_at_100_kHz_spoil_no_save() -> None:
    """A byte is only written if its two instructions follow each other within four cycles."""
    chip = FaultyChip(ELF, params=RobotParams.load())
    run_for(chip, 0.3)
    for side in (0, 1):
        chip.set_glitches(side, 50_000.0)
    for sequence in (1, 2):
        answer = ask(chip, CommandRequest(command=Command.SAVE), Ack, wait_s=0.5)
        assert answer is not None
        assert Ack.unpack(answer.payload).status is AckStatus.OK, sequence
