"""Ctrl-C is never lost: not in a callback from C code, where Python drops the exception."""

import ctypes
import os
import signal
import warnings
from collections.abc import Callable

import pytest

from thumper.common.signals import forget_interrupts, hold_interrupt, raise_lost_interrupt, record_interrupts


def lose_an_interrupt() -> None:
    """Press Ctrl-C while C code calls Python back, as numba does when it loads a kernel."""

    callback = ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.SIGINT))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        callback()


def pass_() -> None:
    """Do nothing."""


def one_pass(work: Callable[[], None]) -> None:
    """Do some work as a pass of the loop does."""
    with raise_lost_interrupt():
        work()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("before", [False, True])
def test_a_lost_interrupt_is_raised_at_the_end_of_the_block(before: bool) -> None:
    with record_interrupts():
        if before:
            lose_an_interrupt()
        with pytest.raises(KeyboardInterrupt):
            one_pass(pass_ if before else lose_an_interrupt)
        one_pass(pass_)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_forgotten_interrupt_is_not_raised() -> None:
    with record_interrupts():
        lose_an_interrupt()
        forget_interrupts()
        one_pass(pass_)


def test_the_first_interrupt_is_held_and_the_second_is_not() -> None:
    with hold_interrupt() as held:
        os.kill(os.getpid(), signal.SIGINT)
        assert held == [signal.SIGINT]
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
