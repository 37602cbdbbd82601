"""The text under the demo's table."""

import re

from thumper_hil.demo.results import FOOTNOTE


def test_the_footnote_has_no_measured_value() -> None:
    assert not re.search(r"\d", FOOTNOTE)
