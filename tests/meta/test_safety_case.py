"""Each hazard of the safety case and each attack of the security page names a test that exists."""

import pytest

from tests.meta.hazard_tables import ROOT, hazards, named_tests

PAGES = {"safety": 65, "security": 35}  # with the least number of rows


@pytest.mark.parametrize("page", PAGES)
def test_every_hazard_has_a_test_that_exists(page: str) -> None:
    assert len(hazards(page)) > PAGES[page]
    assert hazards(page).keys() == named_tests(page).keys()
    for number, tests in named_tests(page).items():
        assert tests, number
        for test in tests:
            file, _, name = test.partition("::")
            assert f"\ndef {name}(" in (ROOT / file).read_text(encoding="utf-8"), f"{number}: {test}"
