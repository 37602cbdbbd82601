"""Every fault and refusal of the board has a text."""

from thumper.board.fault_texts import FAULT_HINTS, REFUSAL_REASONS
from thumper.board.messages import AckStatus, Fault


def test_every_fault_has_a_hint() -> None:
    assert set(FAULT_HINTS) == set(Fault) - {Fault.NONE}


def test_every_refusal_has_a_reason() -> None:
    assert set(REFUSAL_REASONS) == set(AckStatus) - {AckStatus.OK}
