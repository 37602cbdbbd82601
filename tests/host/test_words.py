"""Whatever the board may say, the operator hears it in words."""

from thumper.link.fault_words import FAULT_CURES
from thumper.link.messages import AckStatus, Fault
from thumper.link.refusals import REFUSALS


def test_every_fault_has_its_cure() -> None:
    assert set(FAULT_CURES) == set(Fault) - {Fault.NONE}


def test_every_refusal_has_its_reason() -> None:
    assert set(REFUSALS) == set(AckStatus) - {AckStatus.OK}
