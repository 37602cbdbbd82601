"""The pages agree with the code: links, the example configuration, navigation and topics."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from thumper.config.robot import RobotConfig, load_config
from thumper.ros.topics import TOPICS

ROOT = Path(__file__).parents[2]
SITE = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")), *SITE]

OF_A_GROUP = {"results": "(, measured)?", "benchmarks": ": all figures"}
"""What the heading of a page may have and its entry has not: the menu shows the group's title above it."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_exist(page: Path) -> None:
    prose = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", prose):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_example_configuration_is_the_default(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "reference" / "config.md").read_text(encoding="utf-8")
    block = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    assert block is not None
    path = tmp_path / "robot.toml"
    path.write_text(block.group(1), encoding="utf-8")
    assert load_config(path) == RobotConfig()


def named_in(navigation: list[object]) -> Iterator[tuple[str, str]]:
    """Yield titles and pages in the site's navigation, at any depth."""
    for entry in navigation:
        assert isinstance(entry, dict)
        for title, target in entry.items():
            if isinstance(target, str):
                yield title, target
            else:
                yield from named_in(target)


def test_moving_pictures_load_fast() -> None:
    sizes = {path.name: path.stat().st_size for path in (ROOT / "docs/images").glob("*.webp")}
    assert "explore.webp" in sizes
    assert max(sizes.values()) <= 3_000_000, sizes
    assert sizes["explore.webp"] == pytest.approx(1.1e6, abs=0.05e6)  # as docs/howto/recording.md says


def test_every_page_is_reachable() -> None:
    settings = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))
    reached = {ROOT / "docs" / name for _, name in named_in(settings["project"]["nav"])}
    assert all(page.exists() for page in reached)
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+\.md)[^)]*\)", page.read_text(encoding="utf-8")):
            reached.add((page.parent / target).resolve())
    assert set(SITE) <= reached


def test_the_menu_has_the_headings_of_the_pages() -> None:
    settings = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))
    for title, name in named_in(settings["project"]["nav"]):
        if title not in ("Home", "Overview"):
            heading = re.compile(
                rf"^# {re.escape(title)}{OF_A_GROUP.get(Path(name).parent.name, '')}$", re.MULTILINE
            )
            assert heading.search((ROOT / "docs" / name).read_text(encoding="utf-8")), name


def test_operators_guide_lists_every_topic() -> None:
    rows = [
        line
        for line in (ROOT / "docs" / "reference" / "bus.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")
    ]
    for name, topic in TOPICS.items():
        assert any(f"`{name}`" in row and f"`{topic.type_name}`" in row for row in rows), name
