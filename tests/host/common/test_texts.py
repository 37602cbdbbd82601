"""Numbers in texts for people."""

from thumper.common.texts import place_text
from thumper.navigation.goal import Goal


def test_a_rounded_zero_has_no_sign() -> None:
    assert place_text(-0.004, 0.004) == "(0.00, 0.00)"
    assert str(Goal(x_m=-0.001, y_m=-0.01)) == "(0.00, -0.01)"
