"""One version for the whole project: program, firmware, and the newest entry of the list of changes."""

import re
from pathlib import Path

from thumper import __version__

ROOT = Path(__file__).parents[2]


def test_firmware_program_and_list_of_changes_name_the_same() -> None:
    config = (ROOT / "firmware" / "core" / "config.hpp").read_text(encoding="utf-8")
    names = ("kVersionMajor", "kVersionMinor", "kVersionPatch")
    numbers = [found[1] for name in names if (found := re.search(rf"{name} = (\d+)", config))]
    assert ".".join(numbers) == __version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (\S+)", changes, re.MULTILINE)[0] == __version__
