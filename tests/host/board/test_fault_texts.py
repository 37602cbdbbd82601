"""Every fault and refusal of the board has a text."""

from thumper.board.fault_texts import FAULT_HINTS, FAULT_NAMES, REFUSAL_REASONS, fault_line
from thumper.board.messages import AckStatus, Fault


def test_every_fault_has_a_name_and_a_hint() -> None:
    assert set(FAULT_NAMES) == set(FAULT_HINTS) == set(Fault) - {Fault.NONE}


def test_a_line_says_nothing_twice() -> None:
    assert fault_line(Fault.E_STOP) == "the emergency stop was pressed"
    assert fault_line(Fault.STALL_LEFT).startswith("left wheels stalled: the left wheels do not turn; are")


def test_every_refusal_has_a_reason() -> None:
    assert set(REFUSAL_REASONS) == set(AckStatus) - {AckStatus.OK}
