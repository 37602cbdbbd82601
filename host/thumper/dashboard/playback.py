"""Recordings of the library as packets for the page: the same that it receives from the robot."""

import asyncio
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query
from fastapi.responses import Response

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.dashboard.display_data import pose_list, stamped_pose
from thumper.dashboard.library import library_recording
from thumper.dashboard.page_state import TOPICS, PageState
from thumper.dashboard.rate_limit import RateLimit
from thumper.recording.excerpt import Excerpts, open_excerpts
from thumper.recording.reader import RecordedMessage, Recording
from thumper.ros import topics

PERIOD_S = 0.1  # of the packets, as the robot's control cycle
MAX_PART_S = 10.0
RATE_HZ, BURST = 4.0, 20  # requests of all pages together
TRAIL_S = 60.0  # driven before the part, so that a jump in time has a trail
EVENTS = {"wheels", "events"}  # lists on the page, not a state


def add_playback(app: FastAPI, folder: Path) -> None:
    """Add the route that reads a part of a recording."""
    limit = RateLimit(RATE_HZ, BURST)
    one_at_a_time = asyncio.Semaphore()

    @app.get("/library/recordings/{name}/packets")
    async def packets(
        name: str,
        start_s: Annotated[float, Query(ge=0.0, le=1e7)] = 0.0,
        seconds: Annotated[float, Query(gt=0.0, le=MAX_PART_S)] = MAX_PART_S,
    ) -> Response:
        path = library_recording(folder, name)
        if not limit.allows():
            raise HTTPException(429, "too many requests for recordings; wait a second")
        async with one_at_a_time:
            try:
                content = await asyncio.to_thread(lambda: b"".join(part_of(path, start_s, seconds)))
            except ThumperError as error:
                raise HTTPException(422, str(error)) from error
        return Response(content, media_type="application/octet-stream")


def part_of(path: Path, start_s: float, seconds: float) -> Iterator[bytes]:
    """Yield the packets from `start_s` after the beginning, each after its length (uint32, little-endian).

    The first one holds the whole state at `start_s` and `duration_s`. `playback_s` is the time of each.

    Raises
    ------
    ThumperError
        The recording cannot be read in parts.
    """
    base_from_laser = _base_from_laser(path)
    with open_excerpts(path) as recording:
        for packet in _packets(recording, base_from_laser, start_s, seconds):
            yield struct.pack("<I", len(packet)) + packet


def _packets(recording: Excerpts, base_from_laser: Pose2, start_s: float, seconds: float) -> Iterator[bytes]:
    duration_s = 1e-9 * (recording.end_ns - recording.start_ns)
    start_s = min(start_s, duration_s)
    now_s = start_s
    state = PageState(base_from_laser, lambda: now_s)
    start_ns = recording.start_ns + round(1e9 * start_s)
    end_ns = start_ns + round(1e9 * seconds)
    for message in recording.latest_before([topic for topic in TOPICS if topic not in EVENTS], start_ns):
        _take(state, message)
    state.tick({})
    trail_m = _trail(recording, start_ns - round(1e9 * TRAIL_S), start_ns)
    yield state.full_packet({"playback_s": now_s, "duration_s": round(duration_s, 3), "trail": trail_m})
    for message in recording.messages(TOPICS, start_ns, end_ns):
        while message.log_ns >= recording.start_ns + round(1e9 * (now_s + PERIOD_S)):
            now_s = round(now_s + PERIOD_S, 6)
            yield state.tick({"playback_s": now_s})
        _take(state, message)
    now_s = min(start_s + seconds, duration_s)
    yield state.tick({"playback_s": now_s})


def _trail(recording: Excerpts, start_ns: int, end_ns: int) -> list[float]:
    """Return the driven path in a time range: x, y, x, y, ... [m]."""
    trail_m: list[float] = []
    for message in recording.messages(["pose"], start_ns, end_ns):
        with suppress(ValueError, KeyError):
            trail_m += pose_list(stamped_pose(message.decode())[1])[:2]
    return trail_m


def _take(state: PageState, message: RecordedMessage) -> None:
    if message.type_name != topics.TOPICS[message.topic].type_name:
        return
    with suppress(ValueError, KeyError):  # one damaged message is no reason to stop
        state.on_message(message.topic, message.decode())


def _base_from_laser(path: Path) -> Pose2:
    """Return the mounting of the recorded robot's lidar; of another program's robot none is known."""
    try:
        run = Recording((path,)).run_metadata()
    except ThumperError:
        return Pose2()
    return run.config.lidar.base_from_laser if run else Pose2()
