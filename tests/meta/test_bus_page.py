"""The page of topics and services lists the bus: topics with types, services, commands."""

import re
from pathlib import Path

from thumper.ros.services import SERVICES
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.requests import COMMANDS

PAGE = (Path(__file__).parents[2] / "docs/reference/bus.md").read_text(encoding="utf-8")


def rows(head: str) -> list[list[str]]:
    """Return the cells of the table whose header starts with `head`."""
    block = PAGE[PAGE.index(f"| {head} |") :].split("\n\n", maxsplit=1)[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()[2:]]


def test_lists_every_topic_with_its_type() -> None:
    for head, direction in (("out", Direction.OUT), ("in", Direction.IN)):
        listed = {name: row[1].strip("`") for row in rows(head) for name in re.findall(r"`([^`]+)`", row[0])}
        expected = {name: topic.type_name for name, topic in TOPICS.items() if topic.direction is direction}
        assert listed == expected


def test_lists_the_latched_topics() -> None:
    sentence = re.search(r"\n(.+) are latched", PAGE)
    assert sentence is not None
    assert set(re.findall(r"`([^`]+)`", sentence[1])) == {n for n, topic in TOPICS.items() if topic.latched}


def test_lists_every_service_as_the_table_in_the_code() -> None:
    assert rows("service") == [service.row() for service in SERVICES.values()]


def test_lists_every_command() -> None:
    (row,) = [row for row in rows("in") if row[0] == "`command`"]
    assert set(re.findall(r"`([^`]+)`", row[2])) == set(COMMANDS)
