"""The SCIP 2.0 codec: the examples of the protocol document, and round trips."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from thumper.lidar.scip import (
    MAX_REPLY_BYTES,
    ReplySplitter,
    ScipError,
    checksum,
    decode_values,
    encode_value,
    parse_reply,
    parse_scan,
    parse_table,
    parse_time,
    stream_request,
)

PUBLISHED_VALUES = [(1234, b"CB"), (5432, b"1Dh"), (16_000_000, b"m2@0")]
PUBLISHED_TABLE = b"""PP
00P
MODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N
DMIN:20;4
DMAX:5600;_
ARES:1024;\\
AMIN:44;7
AMAX:725;o
AFRT:384;6
SCAN:600;e"""


def scan_reply(values: list[int], stamp_ms: int, chars: int = 3) -> bytes:
    """Encode a reply block by block, as in the protocol document."""
    data = b"".join(encode_value(value, chars) for value in values)
    lines = [b"99", encode_value(stamp_ms, 4), *(data[i : i + 64] for i in range(0, len(data), 64))]
    return b"MD0000000001000\n" + b"".join(line + bytes([checksum(line)]) + b"\n" for line in lines)


@pytest.mark.parametrize(("value", "text"), PUBLISHED_VALUES)
def test_published_values(value: int, text: bytes) -> None:
    assert encode_value(value, len(text)) == text
    assert decode_values(text, len(text)).tolist() == [value]


def test_published_checksums() -> None:
    assert [chr(checksum(status)) for status in (b"00", b"99", b"02", b"0E")] == ["P", "b", "R", "e"]
    table, bad_lines = parse_table(parse_reply(PUBLISHED_TABLE))
    assert bad_lines == 0
    assert table["MODL"] == "URG-04LX(Hokuyo Automatic Co.,Ltd.)"
    assert (table["DMAX"], table["AFRT"], table["SCAN"]) == ("5600", "384", "600")


def test_a_corrupt_line_is_counted_and_kept() -> None:
    table, bad_lines = parse_table(parse_reply(PUBLISHED_TABLE.replace(b"DMAX:5600;_", b"DMAX:5601;_\nH08")))
    assert bad_lines == 2
    assert table["DMAX"] == "5601"
    assert table["SCAN"] == "600"


def test_a_checksum_that_includes_the_semicolon_is_accepted() -> None:
    line = b"SERI:H0000000;"
    table, bad_lines = parse_table(parse_reply(b"VV\n00P\n" + line + bytes([checksum(line)])))
    assert (table, bad_lines) == ({"SERI": "H0000000"}, 0)


def test_the_stream_request() -> None:
    assert stream_request(44, 725) == b"MD0044072501000\n"
    assert stream_request(0, 768, cluster=3, skip=1, count=10) == b"MD0000076803110\n"


@given(chars=st.integers(1, 4), data=st.data())
def test_values_round_trip(chars: int, data: st.DataObject) -> None:
    values = data.draw(st.lists(st.integers(0, 64**chars - 1), max_size=50))
    text = b"".join(encode_value(value, chars) for value in values)
    assert decode_values(text, chars).tolist() == values


@pytest.mark.parametrize(("value", "chars"), [(-1, 2), (4096, 2), (1 << 18, 3)])
def test_a_value_that_does_not_fit_is_refused(value: int, chars: int) -> None:
    with pytest.raises(ValueError, match="does not fit"):
        encode_value(value, chars)


@pytest.mark.parametrize("text", [b"0", b"0/", b"0p", b"\xff0"])
def test_invalid_characters_are_refused(text: bytes) -> None:
    with pytest.raises(ScipError):
        decode_values(text, 2)


@given(
    values=st.lists(st.integers(0, 5600), min_size=1, max_size=200),
    stamp_ms=st.integers(0, (1 << 24) - 1),
    cuts=st.lists(st.integers(1, 40), max_size=30),
)
def test_a_scan_round_trips_in_any_chunks(values: list[int], stamp_ms: int, cuts: list[int]) -> None:
    """64 is not a multiple of 3, so from the 22nd value on, values span two blocks."""
    stream = scan_reply(values, stamp_ms) + b"\n"
    splitter, raws = ReplySplitter(), []
    for cut in cuts:
        raws += splitter.feed(stream[:cut])
        stream = stream[cut:]
    raws += splitter.feed(stream)
    (raw,) = raws
    scan = parse_scan(parse_reply(raw))
    assert scan.stamp_ms == stamp_ms
    np.testing.assert_array_equal(scan.values_mm, values)


@given(data=st.data())
def test_one_changed_character_is_detected(data: st.DataObject) -> None:
    """A 6-bit sum detects every change of one character within the alphabet of 64."""
    good = scan_reply([100, 2000, 5599] * 20, 77)
    at = data.draw(st.integers(good.index(b"\n") + 1, len(good) - 2))
    new = data.draw(st.integers(0x30, 0x6F))
    assume(good[at] not in {new, 0x0A})  # a lost line feed joins two lines, whose sums may match by chance
    with pytest.raises(ScipError):
        parse_scan(parse_reply(good[:at] + bytes([new]) + good[at + 1 : -1]))


@given(st.lists(st.binary(max_size=300), max_size=8))
def test_no_bytes_crash_the_parser(chunks: list[bytes]) -> None:
    splitter = ReplySplitter()
    for chunk in chunks:
        for raw in splitter.feed(chunk):
            try:
                reply = parse_reply(raw)
                parse_table(reply)
                parse_scan(reply)
                parse_time(reply)
            except ScipError:
                pass
    whole = scan_reply([1, 2, 3], 5)
    raws = splitter.feed(b"\n\n" + whole + b"\n")
    assert parse_scan(parse_reply(raws[-1])).values_mm.tolist() == [1, 2, 3]


def test_an_endless_reply_is_dropped() -> None:
    splitter = ReplySplitter()
    assert splitter.feed(b"x" * (MAX_REPLY_BYTES + 1)) == []
    assert splitter.overruns == 1
    assert len(splitter.feed(scan_reply([1], 1) + b"\n")) == 1
