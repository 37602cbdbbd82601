"""Decode UBX: frames of real receivers, frames in pieces and between NMEA, damaged and arbitrary bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.gps.fix import FixStatus
from thumper.gps.nmea import SentenceDecoder
from thumper.gps.ubx import NAV_COV, NAV_PVT, SYNC, UbxSplitter, checksum, fix_of_pvt, with_cov

# Payloads of a ZED-F9P and its NMEA of the same place (the test data of pyubx2).
PVT = bytes.fromhex(
    "28731c07e5070216090807f72f040000b91405000301a6041e2daafe2feddb1f181c0100b55e00004ed80000158a00006a010000"
    "ceffffffb9ffffff6d010000000000009c110000bc79cf0008020000ee134f2f0000000000000000"
)
COV = bytes.fromhex(
    "28731c070001010016b2d03f64218b3ffe241e455e3756c4d7828bc4c5ff0544dd97394415319c4473de8c41b0948bc07e02bbc0"
    "6f4d164041d73b40c6f39240"
)
GGA = b"$GNGGA,090802.00,5327.03976,N,00214.41006,W,1,04,4.39,23.0,M,48.5,M,,*6D\r\n"


def framed(kind: bytes, payload: bytes) -> bytes:
    content = kind + len(payload).to_bytes(2, "little") + payload
    return SYNC + content + checksum(content)


MIXED = framed(NAV_PVT, PVT) + GGA + framed(NAV_COV, COV)


def test_a_real_fix_agrees_with_the_nmea_of_the_same_receiver() -> None:
    frames, rest = UbxSplitter().feed(MIXED)
    assert [frame.kind for frame in frames] == [NAV_PVT, NAV_COV]
    fix = fix_of_pvt(frames[0].payload, 5.0)
    assert fix is not None
    assert fix.status is FixStatus.GPS
    (gga,) = SentenceDecoder().feed(rest)
    assert (fix.latitude_deg, fix.longitude_deg) == pytest.approx(
        (gga.lat, gga.lon), abs=5e-5
    )  # 5 s and 5 m later
    refined = with_cov(fix, frames[1].payload)
    assert sum(refined.variances_m2[:2]) == pytest.approx(sum(fix.variances_m2[:2]), rel=1e-3)
    assert refined.variances_m2 == pytest.approx((535.996, 2530.312, 1249.534), abs=1e-3)  # east, north, up


@pytest.mark.parametrize(
    ("flags", "status"),
    [
        (0b00_0000_01, FixStatus.GPS),
        (0b00_0000_11, FixStatus.SBAS),
        (0b01_0000_11, FixStatus.RTK_FLOAT),
        (0b10_0000_11, FixStatus.RTK),
    ],
)
def test_the_carrier_solution_decides_between_float_and_fixed(flags: int, status: FixStatus) -> None:
    fix = fix_of_pvt(PVT[:21] + bytes([flags]) + PVT[22:], 0.0)
    assert fix is not None
    assert fix.status is status


@given(st.lists(st.integers(1, 90), min_size=1, max_size=20))
def test_frames_in_pieces_are_the_same_frames(sizes: list[int]) -> None:
    splitter, data, kinds, rest = UbxSplitter(), 3 * MIXED, [], b""
    for size in [*sizes, len(data)]:
        frames, other = splitter.feed(data[:size])
        kinds += [frame.kind for frame in frames]
        data, rest = data[size:], rest + other
    assert kinds == 3 * [NAV_PVT, NAV_COV]
    assert rest == 3 * GGA
    assert splitter.bad == 0


@given(st.integers(2, len(PVT) + 7), st.integers(1, 255))
def test_a_damaged_frame_never_becomes_a_position(place: int, flip: int) -> None:
    damaged = bytearray(framed(NAV_PVT, PVT))
    damaged[place] ^= flip
    frames, _ = UbxSplitter().feed(bytes(damaged) + framed(NAV_COV, COV) + 5000 * b"\0")
    assert [frame.kind for frame in frames] == [NAV_COV]


@given(st.binary(max_size=300))
def test_it_reads_on_after_arbitrary_bytes(noise: bytes) -> None:
    splitter = UbxSplitter()
    splitter.feed(noise)
    splitter.feed(5000 * b"\0")  # the noise may begin a frame
    assert len(splitter.feed(MIXED)[0]) == 2


def test_an_impossible_position_is_refused() -> None:
    beyond = PVT[:28] + (910_000_000).to_bytes(4, "little") + PVT[32:]  # latitude 91
    assert fix_of_pvt(beyond, 0.0) is None
