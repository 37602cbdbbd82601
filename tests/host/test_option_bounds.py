"""Numbers that a command cannot do anything sensible with are refused by its options, before any port."""

import pytest
from typer.testing import CliRunner

from thumper.cli import build_app

HUGE = "9" * 23


@pytest.mark.parametrize(
    ("command", "option", "value"),
    [
        ("run --goal 1 0", "--patrol", "100000000000"),
        ("demo", "--seeds", HUGE),
        ("run --goal 1 0", "--tolerance", "1e9"),
        ("plan none.yaml --start 0 0 --goal 1 0", "--tolerance", "1e9"),
    ],
)
def test_a_number_out_of_bounds_names_its_option(command: str, option: str, value: str) -> None:
    result = CliRunner().invoke(build_app(), [*command.split(), option, value])
    assert result.exit_code == 2
    assert option in result.output
    assert "less than or equal" in result.output
