"""Program, firmware, CHANGELOG and site have one version."""

import re
from pathlib import Path

from thumper import __version__

ROOT = Path(__file__).parents[2]


def test_firmware_program_and_changelog_agree() -> None:
    config = (ROOT / "firmware" / "core" / "config.hpp").read_text(encoding="utf-8")
    names = ("kVersionMajor", "kVersionMinor", "kVersionPatch")
    numbers = [found[1] for name in names if (found := re.search(rf"{name} = (\d+)", config))]
    assert ".".join(numbers) == __version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = [name for name in re.findall(r"^## (\S+)", changes, re.MULTILINE) if name != "Unreleased"]
    assert versions[0] == __version__
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [__version__]
    site = (ROOT / "zensical.toml").read_text(encoding="utf-8")
    assert re.findall(r'^copyright = "Thumper ([^,]+),', site, re.MULTILINE) == [__version__]
