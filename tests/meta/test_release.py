"""What a release needs: a description without dead links, and the notes of its version."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from scripts.index_readme import absolute

from thumper.common.version import __version__

ROOT = Path(__file__).parents[2]


def test_description_on_an_index_has_no_relative_links() -> None:
    text = (ROOT / "README.md").read_text()
    for base in ("", "https://example.org/{kind}/v1"):
        shown = absolute(text, base)
        assert not re.findall(r"\]\((?!https://)[^)]*\)", shown)
        assert not re.findall(r'src(?:set)?="(?!https://)', shown)
        assert "picture>" not in shown
    assert "![A path around" in text
    assert "<picture><source" in text
    assert "](https://example.org/raw/v1/docs/images/plan_keepout.png)" in shown
    assert '<img src="https://example.org/raw/v1/docs/images/explore.webp" width=' in shown
    assert "](https://example.org/blob/v1/docs/explanation/safety.md)" in shown


def test_release_notes_are_the_section_of_the_version(tmp_path: Path) -> None:
    """An unreleased section, another version and a version without notes are refused."""
    for name in ("scripts/release-notes", "host/thumper/common/version.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        shutil.copy(ROOT / name, tmp_path / name)

    def notes(changes: str, version: str = __version__) -> tuple[int, str]:
        (tmp_path / "CHANGELOG.md").write_text(changes)
        command = [str(tmp_path / "scripts/release-notes"), version]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        return done.returncode, done.stdout

    changes = (
        f"# Changes\n\n## Unreleased\n\n- a\n\n## {__version__} - 2030-01-02\n\n- b\n\n## 0.1.0\n\n- c\n"
    )
    assert notes(changes) == (0, "\n- b\n")
    assert notes(changes, "0.1.0") == (1, "")
    assert notes(f"## {__version__} (unreleased)\n\n- b\n") == (1, "")


@pytest.mark.parametrize(
    ("setting", "addresses"),
    [
        ("REPOSITORY=", (None, None)),
        ("GITHUB_REPOSITORY=owner/name", ("https://github.com/owner/name", "https://owner.github.io/name/")),
    ],
)
def test_site_links_the_repository_if_it_is_known(
    tmp_path: Path, setting: str, addresses: tuple[str | None, str | None]
) -> None:
    shutil.copy(ROOT / "zensical.toml", tmp_path)
    make = ["make", "--no-print-directory", "--dry-run", setting, "docs"]
    printed = subprocess.check_output(make, cwd=ROOT, text=True)
    change, build = [line for line in printed.splitlines() if ".site.toml" in line]
    assert build.endswith("--config-file .site.toml")
    subprocess.run(change, shell=True, cwd=tmp_path, check=True)
    project = tomllib.loads((tmp_path / ".site.toml").read_text())["project"]
    assert (project.get("repo_url"), project.get("site_url")) == addresses
