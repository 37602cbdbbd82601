"""Decode NMEA: u-blox's examples, real receivers, sentences in pieces, damaged and arbitrary bytes."""

import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pynmeagps import calc_checksum  # type: ignore[import-untyped]

from thumper.gps.fix import FixStatus
from thumper.gps.nmea import SentenceDecoder, fix_of_gga, with_gst

# u-blox M8 interface description, 31.2.4 and 31.2.9.
GGA = b"$GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,*5B\r\n"
GST = b"$GPGST,082356.00,1.8,,,,1.7,1.3,2.2*7E\r\n"
RECORDED = (  # a ZED-F9P, a UM981 and a receiver that has just started (the test data of pynmeagps)
    b"$GNGGA,103607.00,5327.03942,N,00214.42462,W,1,06,5.88,56.0,M,48.5,M,,*64\r\n"
    b"$GNGST,103607.00,38,60,38,89,15,24,31*63\r\n"
    b"$GNGGA,130058.00,5327.03598945,N,00214.41467156,W,1,08,7.5,36.3017,M,51.6775,M,,*5B\r\n"
    b"$GNGLL,5327.03598945,N,-0214.41467156,W,130058.00,A,A*7E\r\n"
    b"\xb5b\x01\x07$\x00\n$GNGGA,,,,,,0,00,99.99,,,,,,*56\r\n"
)
POSITION = "4717.11399,N,00833.91590,E"


def sentence(text: str) -> bytes:
    return f"${text}*{calc_checksum(text)}\r\n".encode("latin-1")


def test_the_examples_of_the_interface_description() -> None:
    gga, gst = SentenceDecoder().feed(GGA + GST)
    fix = with_gst(fix_of_gga(gga, 5.0), gst)
    assert fix.status is FixStatus.GPS
    assert fix.latitude_deg == pytest.approx(47.0 + 17.11399 / 60.0)
    assert fix.longitude_deg == pytest.approx(8.0 + 33.91590 / 60.0)
    assert fix.altitude_m == pytest.approx(547.6)
    assert fix.variances_m2 == pytest.approx((1.3**2, 1.7**2, 2.2**2))  # the sentence has latitude first


def test_sentences_of_real_receivers() -> None:
    decoder = SentenceDecoder()
    messages = list(decoder.feed(RECORDED))
    assert [message.msgID for message in messages] == ["GGA", "GST", "GGA", "GGA"]
    fix = with_gst(fix_of_gga(messages[0], 0.0), messages[1])
    assert fix.longitude_deg == pytest.approx(-(2.0 + 14.42462 / 60.0))
    assert fix.std_m == 24.0
    assert fix_of_gga(messages[2], 0.0).std_m == pytest.approx(2.0 * 7.5)  # by its dilution of precision
    assert fix_of_gga(messages[3], 0.0).status is FixStatus.NONE
    assert decoder.bad == 1  # the binary message between


@pytest.mark.parametrize(
    ("quality", "text"),
    [
        (0, "no fix"),
        (1, "GPS fix, 2.00 m"),
        (2, "SBAS fix, 1.00 m"),
        (4, "RTK fix, 0.02 m"),
        (5, "RTK float, 0.50 m"),
        (6, "no fix"),
    ],
)
def test_each_quality_has_its_name(quality: int, text: str) -> None:
    gga = sentence(f"GPGGA,092725.00,{POSITION},{quality},08,1.0,499.6,M,48.0,M,,")
    (message,) = SentenceDecoder().feed(gga)
    assert fix_of_gga(message, 0.0).text == text


@given(st.lists(st.integers(1, 60), min_size=1, max_size=20))
def test_sentences_in_pieces_are_the_same_sentences(sizes: list[int]) -> None:
    decoder, data, count = SentenceDecoder(), 3 * (GGA + GST), 0
    for size in sizes:
        count += len(list(decoder.feed(data[:size])))
        data = data[size:]
    count += len(list(decoder.feed(data)))
    assert (count, decoder.bad) == (6, 0)


@given(st.integers(1, len(GGA) - 6), st.integers(1, 255))
def test_a_damaged_sentence_never_becomes_a_position(place: int, flip: int) -> None:
    damaged = bytearray(GGA)
    damaged[place] ^= flip
    messages = list(SentenceDecoder().feed(bytes(damaged) + GST))
    assert [message.msgID for message in messages][-1] == "GST"
    assert len(messages) == 1


@given(st.binary(max_size=300))
def test_it_reads_on_after_arbitrary_bytes(noise: bytes) -> None:
    decoder = SentenceDecoder()
    list(decoder.feed(noise))
    list(decoder.feed(GGA))  # its start may complete a false sentence
    assert len(list(decoder.feed(GGA))) == 1


@pytest.mark.parametrize(
    "text",
    [
        "GPGGA,092725.00,,N,00833.91590,E,1,08,1.0,499.6,M,48.0,M,,",
        "GPGGA,092725.00,9511.0,N,00833.91590,E,1,08,1.0,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4717.1,N,18100.0,E,1,08,1.0,499.6,M,48.0,M,,",
        "GPGGA,092725.00,nan,N,00833.91590,E,1,08,1.0,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4717.1,N,inf,E,1,08,1.0,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4717.1,?,00833.91590,E,1,08,1.0,499.6,M,48.0,M,,",
        f"GPGGA,256199.00,{POSITION},1,08,1.0,499.6,M,48.0,M,,",
        f"GPGGA,,{POSITION},1,08,1.0,499.6,M,48.0,M,,",
        f"GPGGA,092725.00,{POSITION},x,08,1.0,499.6,M,48.0,M,,",
        f"GPGGA,092725.00,{POSITION},1,08,1e300,499.6,M,48.0,M,,",
        f"GPGGA,092725.00,{POSITION},1,08,nan,499.6,M,48.0,M,,",
        f"GPGGA,092725.00,{POSITION},1,08,1.0,1e999,M,48.0,M,,",
        f"GPGGA,092725.00,{POSITION},1",
        "GPGGA,092725.00",
        "GPGGA,",
        "GPGST,",
        "GPGST,092725.00,1.8,,,",
        "GPGST,092725.00,1.8,,,,1e999,1.3,2.2",
        "GPGST,092725.00,1.8,,,,nan,1.3,2.2",
        "GPGGA,\xe9\xff,\x00",
    ],
)
def test_a_sentence_with_missing_or_impossible_fields_is_counted_and_ignored(text: str) -> None:
    decoder = SentenceDecoder()
    assert list(decoder.feed(sentence(text))) == []
    assert (decoder.good, decoder.bad) == (0, 1)
    assert len(list(decoder.feed(GGA + GST))) == 2


def test_a_wrong_checksum_is_counted() -> None:
    decoder = SentenceDecoder()
    assert list(decoder.feed(GGA.replace(b"*5B", b"*5C"))) == []
    assert (decoder.good, decoder.bad) == (0, 1)


def test_an_endless_line_is_counted_and_takes_no_memory() -> None:
    decoder = SentenceDecoder()
    assert list(decoder.feed(b"$GPGGA," + 10_000 * b"1")) == []
    assert decoder.bad == 1
    tracemalloc.start()
    for _ in range(1000):
        assert list(decoder.feed(1000 * b"1")) == []
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_bytes < 100_000
    assert len(list(decoder.feed(b"\r\n" + GGA + GST))) == 2
