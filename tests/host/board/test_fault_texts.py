"""Whatever the board may say, the operator hears it in words."""

from thumper.board.fault_texts import FAULT_CURES, REFUSALS
from thumper.board.messages import AckStatus, Fault


def test_every_fault_has_its_cure() -> None:
    assert set(FAULT_CURES) == set(Fault) - {Fault.NONE}


def test_every_refusal_has_its_reason() -> None:
    assert set(REFUSALS) == set(AckStatus) - {AckStatus.OK}
