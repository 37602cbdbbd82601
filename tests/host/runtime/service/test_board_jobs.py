"""Queries for the board are spread over cycles, and each is answered."""

from collections.abc import Mapping
from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.ros.services import ParameterValues
from thumper.runtime.requests import Query
from thumper.runtime.service.board_jobs import MAX_PENDING, TIME_SLICE_S, BoardJob, BoardJobQueue


class Clock:
    """The board's clock: it advances while a request is answered."""

    def __init__(self) -> None:
        self.now_s = 5.0

    def __call__(self) -> float:
        return self.now_s


def ask(answers: list[Mapping[str, Any]]) -> Query:
    return Query(name="", content={}, reply=answers.append)


def requests(
    count: int, clock: Clock, each_s: float, error: Exception | None = None
) -> BoardJob[ParameterValues]:
    for _ in range(count):
        clock.now_s += each_s
        yield
    if error is not None:
        raise error
    return ParameterValues(values={"asked": count})


@pytest.mark.parametrize(("each_s", "cycles"), [(0.001, 1), (0.016, 4), (0.1, 8)])
def test_a_cycle_spends_its_time_slice_and_at_least_one_request(each_s: float, cycles: int) -> None:
    clock, jobs, answers = Clock(), BoardJobQueue(), list[Mapping[str, Any]]()
    jobs.add(ask(answers), requests(7, clock, each_s))
    for cycle in range(cycles):
        assert (len(answers), bool(jobs)) == (0, True)
        start_s = clock.now_s
        jobs.run_for(clock)
        assert clock.now_s - start_s < TIME_SLICE_S + each_s, cycle
    assert answers == [{"ok": True, "values": {"asked": 7}}]
    assert not jobs


def test_a_failed_job_is_answered_and_the_next_one_runs() -> None:
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


def test_a_full_queue_refuses_and_a_lost_board_answers_all() -> None:
    clock, jobs, answers = Clock(), BoardJobQueue(), list[Mapping[str, Any]]()
    for _ in range(MAX_PENDING):
        jobs.add(ask(answers), requests(1, clock, 0.001))
    with pytest.raises(ThumperError, match="ask again"):
        jobs.add(ask(answers), requests(1, clock, 0.001))
    jobs.refuse("the board has gone")
    assert answers == MAX_PENDING * [{"ok": False, "error": "the board has gone"}]
    assert not jobs
