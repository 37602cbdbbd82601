"""An error's exit code chooses its class, so that a script can tell them apart."""

import pickle

import pytest

from thumper.common.errors import (
    EXIT_CHECK_FAILED,
    EXIT_NOT_THERE,
    EXIT_USAGE,
    NotThereError,
    ThumperError,
    UsageError,
)


@pytest.mark.parametrize(
    ("exit_code", "kind"),
    [
        (1, ThumperError),
        (EXIT_USAGE, UsageError),
        (EXIT_NOT_THERE, NotThereError),
        (EXIT_CHECK_FAILED, ThumperError),
    ],
)
def test_the_exit_code_chooses_the_class(exit_code: int, kind: type[ThumperError]) -> None:
    error = ThumperError("a problem; a fix", exit_code=exit_code, option="--board")
    assert type(error) is kind
    copy = pickle.loads(pickle.dumps(error))  # from a second process
    assert (type(copy), str(copy), copy.exit_code, copy.option) == (
        kind,
        "a problem; a fix",
        exit_code,
        "--board",
    )
