"""Test the simulated URG-04LX as a SCIP 2.0 device: replies, their timing and error codes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scip import RawScan, ReplySplitter, parse_reply, parse_scan, parse_table, parse_time
from thumper_hil.lidars.urg04lx import Urg04Lx
from thumper_hil.world.world import World

ROOM = World.load("lab")
FULL = b"MD0044072501000"


def standing(times_s: FloatArray) -> FloatArray:
    return np.zeros((times_s.size, 3))


class Talk:
    """A device and its current time."""

    def __init__(self, *, seed: int = 1, world: World = ROOM) -> None:
        self.device = Urg04Lx(world=world, pose_at=standing, base_from_laser=Pose2(), seed=seed)
        self.time_s = 0.0

    def ask(self, line: bytes, wait_s: float = 0.02) -> bytes:
        self.device.write(line + b"\n", self.time_s)
        return self.wait(wait_s)

    def wait(self, seconds: float) -> bytes:
        self.time_s += seconds
        self.device.advance(self.time_s)
        return self.device.read()

    def status(self, line: bytes) -> str:
        return parse_reply(self.ask(line).removesuffix(b"\n\n")).status

    def scans(self, line: bytes, seconds: float, chars: int = 3) -> list[RawScan]:
        replies = ReplySplitter().feed(self.ask(line, seconds))
        return [parse_scan(reply, chars) for reply in map(parse_reply, replies) if reply.lines]


@pytest.mark.parametrize(
    ("line", "status"),
    [
        (b"MD0044072501", "0C"),
        (b"MD00440725010000", "0E"),
        (b"MDxx44072501000", "01"),
        (b"MD0044xx2501000", "02"),
        (b"MD00440725xx000", "03"),
        (b"MD0044076901000", "04"),
        (b"MD0100009901000", "05"),
        (b"MD0044072501x00", "06"),
        (b"MD00440725010x0", "07"),
        (b"GD0044072501", "10"),
        (b"SCIP2.0", "0E"),
        (b"ME0044072501000", "0E"),
        (b"qt", "0D"),
        (b"TM1", "04"),
        (b"TM2", "03"),
        (b"TM7", "01"),
        (b"SS115200", "04"),
        (b"SS12345", "0C"),
        (b"QT;a remark far too long", "0G"),
        (b"QT;sixteen letters!", "0H"),
        (b"CR00", "03"),
        (b"CR05", "04"),
        (b"CR11", "02"),
        (b"CRxx", "01"),
        (b"CR1", "0C"),
        (b"HS0", "02"),
        (b"HS1", "03"),
        (b"HS7", "01"),
        (b"DB02", "04"),
        (b"DB10", "03"),
        (b"DB99", "01"),
    ],
)
def test_refused_request_is_echoed_with_its_status(line: bytes, status: str) -> None:
    reply = parse_reply(Talk().ask(line).removesuffix(b"\n\n"))
    assert (reply.echo.encode(), reply.status, reply.lines) == (line, status, ())


def test_laser_and_clock_modes() -> None:
    talk = Talk()
    assert [talk.status(line) for line in (b"BM", b"BM", b"QT", b"BM")] == ["00", "02", "00", "00"]
    lines = (b"TM0", b"TM0", b"BM", b"QT", b"VV", b"TM2", b"BM")
    assert [talk.status(line) for line in lines] == ["00", "02", "0A", "0A", "0A", "00", "00"]


def test_laser_goes_off_after_the_last_requested_scan() -> None:
    talk = Talk()
    talk.ask(b"MD0044072501002", 0.5)
    assert talk.status(b"GD0044072501") == "10"
    assert talk.status(b"BM") == "00"


def test_the_clock_wraps_at_24_bits() -> None:
    talk = Talk()
    talk.device._booted_s = -16777.2  # 2**24 ms are 16777.216 s
    talk.ask(b"TM0")
    stamps_ms = [parse_time(parse_reply(talk.ask(b"TM1").removesuffix(b"\n\n"))) for _ in range(2)]
    assert max(stamps_ms) < 60
    talk.ask(b"TM2")
    talk.device._booted_s = -16777.0 + talk.time_s
    stamps_ms = [scan.stamp_ms for scan in talk.scans(b"MD0044072501005", 1.0)]
    assert min(stamps_ms) < 500 < max(stamps_ms)
    assert set(np.diff(stamps_ms) % 2**24) <= {99, 100, 101}


def test_tables_have_valid_checksums_and_the_real_geometry() -> None:
    talk = Talk()
    for line in (b"VV", b"PP", b"II", b"PP;remark"):
        raw = talk.ask(line)
        assert raw.startswith(line + b"\n00P\n")
        assert raw.endswith(b"\n\n")
        table, bad_lines = parse_table(parse_reply(raw.removesuffix(b"\n\n")))
        assert bad_lines == 0
        assert len(table) == {b"VV": 5, b"PP": 8, b"II": 7}[line[:2]]
    assert (table["AMIN"], table["AMAX"], table["AFRT"], table["ARES"]) == ("44", "725", "384", "1024")


def test_clock_counts_milliseconds_and_reset_clears_it() -> None:
    talk = Talk()
    talk.ask(b"RS")
    assert talk.status(b"TM0") == "00"
    first_ms, second_ms = (
        parse_time(parse_reply(talk.ask(b"TM1", 0.5).removesuffix(b"\n\n"))) for _ in range(2)
    )
    assert second_ms - first_ms in {499, 500, 501}
    assert first_ms < 100


def test_scans_arrive_at_10_hz_after_their_revolution() -> None:
    talk = Talk()
    assert talk.status(FULL) == "00"
    arrivals_s, stamps_ms, splitter = [], [], ReplySplitter()
    for _ in range(1000):
        for raw in splitter.feed(talk.wait(0.001)):
            arrivals_s.append(talk.time_s)
            stamps_ms.append(parse_scan(parse_reply(raw)).stamp_ms)
    assert len(arrivals_s) in {9, 10}
    assert set(np.diff(stamps_ms)) <= {99, 100, 101}
    np.testing.assert_allclose(np.diff(arrivals_s), 0.1, atol=0.0011)
    talk.ask(b"QT")
    talk.ask(b"TM0")
    now_ms = parse_time(parse_reply(talk.ask(b"TM1", 0.002).removesuffix(b"\n\n")))
    stamp_s = talk.time_s - 1e-3 * (now_ms - stamps_ms[-1])
    assert arrivals_s[-1] - stamp_s == pytest.approx(0.075 + 0.004, abs=0.003), (
        "3/4 revolution and the transfer"
    )


def test_first_scan_starts_after_its_request() -> None:
    """A revolution that is already running is not delivered; the first scan starts after the request."""
    for seed in range(20):
        talk = Talk(seed=seed)
        talk.wait(0.01 * seed)
        requested_s = talk.time_s
        talk.device.write(FULL + b"\n", talk.time_s)
        while b"\n99b" not in talk.wait(0.001):
            pass
        assert talk.time_s - requested_s >= 0.075


def test_count_and_skip() -> None:
    talk = Talk()
    raw = talk.ask(b"MD0044072500003", 2.0)
    echoes = [reply.split(b"\n")[0] for reply in ReplySplitter().feed(raw)]
    assert echoes == [b"MD0044072500003", b"MD0044072500002", b"MD0044072500001", b"MD0044072500000"]
    assert len(talk.scans(b"MD0044072500400", 2.0)) == 4, "one revolution in five"


def test_cluster_reports_the_nearest_beam() -> None:
    wall = World(segments_m=np.array([[1.0, -1.0, 1.0, 1.0]]), circles_m=np.zeros((0, 3)))
    (single,) = Talk(world=wall).scans(b"MD0044072501001", 0.5)
    (grouped,) = Talk(world=wall).scans(b"MD0044072510001", 0.5)  # the same revolution of the same device
    assert single.stamp_ms == grouped.stamp_ms
    groups = [single.values_mm[first : first + 10] for first in range(0, 682, 10)]
    least = [min(group[group >= 20], default=min(group)) for group in groups]
    assert grouped.values_mm.tolist() == least
    assert min(least) < 20 < max(least), "the scan has clusters of both kinds"


def test_two_character_values_are_at_most_4095() -> None:
    far = World(segments_m=np.array([[4.9, -9.0, 4.9, 9.0]]), circles_m=np.zeros((0, 3)))
    assert Talk(world=far).scans(b"MS0384038401001", 0.5, chars=2)[0].values_mm.tolist() == [4095]


def test_steps_outside_the_field_of_view_have_an_error_code() -> None:
    values_mm = Talk().scans(b"MD0000076801001", 0.5)[0].values_mm
    assert values_mm.size == 769
    assert set(values_mm[:44]) == set(values_mm[726:]) == {19}


def test_gd_gives_one_scan_while_the_laser_is_on() -> None:
    talk = Talk()
    talk.ask(b"BM")
    reply = parse_reply(talk.ask(b"GD0044072501;x", 0.2).removesuffix(b"\n\n"))
    assert (reply.echo, reply.status) == ("GD0044072501;x", "00")
    assert parse_scan(reply).values_mm.size == 682
    assert talk.wait(0.5) == b""


def test_same_seed_same_bytes() -> None:
    def run(seed: int) -> bytes:
        return Talk(seed=seed).ask(FULL, 1.0)

    assert run(3) == run(3)
    assert run(3) != run(4)


@settings(max_examples=60, deadline=None)
@given(chunks=st.lists(st.binary(max_size=40), max_size=10))
def test_arbitrary_bytes_do_not_break_the_device(chunks: list[bytes]) -> None:
    talk = Talk()
    for chunk in chunks:
        talk.ask(chunk)
    talk.ask(b"")
    talk.ask(b"TM2")
    talk.ask(b"QT")
    talk.wait(0.3)
    assert talk.ask(b"QT") == b"QT\n00P\n\n"
