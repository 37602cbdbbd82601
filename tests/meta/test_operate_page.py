"""The operator's page names what there is on the bus: topics with their types, questions, options."""

import re
from dataclasses import fields
from pathlib import Path

from thumper.bus.request_decoder import QUESTIONS
from thumper.config.bus import BusOptions
from thumper.config.manual_drive import ManualDriveOptions
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.requests import COMMANDS

PAGE = (Path(__file__).parents[2] / "docs" / "operate.md").read_text(encoding="utf-8")


def rows(head: str) -> list[list[str]]:
    """Cells of the table whose head begins like this."""
    block = PAGE[PAGE.index(f"| {head} |") :].split("\n\n", maxsplit=1)[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()[2:]]


def test_every_topic_is_told_with_its_type() -> None:
    for head, direction in (("out", Direction.OUT), ("in", Direction.IN)):
        told = {name: row[1].strip("`") for row in rows(head) for name in re.findall(r"`([^`]+)`", row[0])}
        there = {name: topic.type_name for name, topic in TOPICS.items() if topic.direction is direction}
        assert told == there


def test_every_latched_topic_is_told() -> None:
    sentence = re.search(r"\n(.+) are latched", PAGE)
    assert sentence is not None
    assert set(re.findall(r"`([^`]+)`", sentence[1])) == {n for n, topic in TOPICS.items() if topic.latched}


def test_every_question_is_told() -> None:
    told = [name for row in rows("query") for name in re.findall(r"`([^`]+)`", row[0])]
    assert sorted(told) == sorted(QUESTIONS)


def test_every_command_is_told() -> None:
    (row,) = [row for row in rows("in") if row[0] == "`command`"]
    assert set(re.findall(r"`([^`]+)`", row[2])) == set(COMMANDS)


def test_every_option_is_told_with_its_default() -> None:
    for head, options, column in (("`[bus]`", BusOptions(), 2), ("`[service]`", ManualDriveOptions(), 3)):
        told = {row[0].strip("`"): row[column].strip('`"') for row in rows(head)}
        assert told == {field.name: str(getattr(options, field.name)) for field in fields(options)}
