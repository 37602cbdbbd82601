"""Questions to the board: bit by bit, each answered, none for ever."""

from collections.abc import Mapping
from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.runtime.requests import Query
from thumper.runtime.service.board_jobs import MAX_PENDING, TIME_SLICE_S, BoardJob, BoardJobQueue


class Clock:
    """The board's: it goes on while a request is answered."""

    def __init__(self) -> None:
        self.now_s = 5.0

    def __call__(self) -> float:
        return self.now_s


def ask(answers: list[Mapping[str, Any]]) -> Query:
    return Query(name="", content={}, reply=answers.append)


def requests(count: int, clock: Clock, each_s: float, error: Exception | None = None) -> BoardJob:
    for _ in range(count):
        clock.now_s += each_s
        yield
    if error is not None:
        raise error
    return {"asked": count}


@pytest.mark.parametrize(("each_s", "beats"), [(0.001, 1), (0.016, 4), (0.1, 8)])
def test_a_beat_gives_its_share_of_time_and_at_least_one_request(each_s: float, beats: int) -> None:
    clock, jobs, answers = Clock(), BoardJobQueue(), list[Mapping[str, Any]]()
    jobs.add(ask(answers), requests(7, clock, each_s))
    for beat in range(beats):
        assert (len(answers), bool(jobs)) == (0, True)
        begun_s = clock.now_s
        jobs.run_for(clock)
        assert clock.now_s - begun_s < TIME_SLICE_S + each_s, beat
    assert answers == [{"ok": True, "asked": 7}]
    assert not jobs


def test_one_that_fails_is_answered_with_why_and_the_next_one_is_done() -> None:
    clock, jobs, answers = Clock(), BoardJobQueue(), list[Mapping[str, Any]]()
    for error in (ThumperError("it is silent"), IndexError("7"), None):
        jobs.add(ask(answers), requests(1, clock, 0.001, error))
    jobs.run_for(clock)
    assert [answer.get("error") for answer in answers] == [
        "it is silent",
        "internal error: IndexError: 7",
        None,
    ]
    assert [answer["ok"] for answer in answers] == [False, False, True]


def test_a_flood_is_refused_and_a_lost_board_answers_all_that_wait() -> None:
    clock, jobs, answers = Clock(), BoardJobQueue(), list[Mapping[str, Any]]()
    for _ in range(MAX_PENDING):
        jobs.add(ask(answers), requests(1, clock, 0.001))
    with pytest.raises(ThumperError, match="ask again"):
        jobs.add(ask(answers), requests(1, clock, 0.001))
    jobs.refuse("the board has gone")
    assert answers == MAX_PENDING * [{"ok": False, "error": "the board has gone"}]
    assert not jobs
